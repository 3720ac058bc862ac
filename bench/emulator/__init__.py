"""A network in a box: impairs what passes between a client, the console and the robot. docs/networks.md tells how."""

from bench.emulator.delay import Constant, Lognormal, Normal, Pareto, Uniform
from bench.emulator.errors import BadDescription, EmulatorError, NamespacesUnavailable, ProfileError
from bench.emulator.impairment import Impairment, Reordering
from bench.emulator.loss import bursty, independent
from bench.emulator.network import Network
from bench.emulator.network_process import NetworkProcess
from bench.emulator.network_statistics import NetworkStatistics, QueueStatistics
from bench.emulator.path import PathStatistics
from bench.emulator.profile import Profile, even_profile, load_profile, parse_profile, profile_names

__all__ = [
    "BadDescription",
    "Constant",
    "EmulatorError",
    "Impairment",
    "Lognormal",
    "NamespacesUnavailable",
    "Network",
    "NetworkProcess",
    "NetworkStatistics",
    "Normal",
    "Pareto",
    "PathStatistics",
    "Profile",
    "ProfileError",
    "QueueStatistics",
    "Reordering",
    "Uniform",
    "bursty",
    "even_profile",
    "independent",
    "load_profile",
    "parse_profile",
    "profile_names",
]
