"""Emulates a network between a client, the console and the robot. docs/networks.md describes it."""

from lockstep.bench.emulator.errors import BadDescription, EmulatorError, NamespacesUnavailable, ProfileError
from lockstep.bench.emulator.impairment.delay import Constant, Lognormal, Normal, Pareto, Uniform
from lockstep.bench.emulator.impairment.impairment import Impairment, Reordering
from lockstep.bench.emulator.impairment.loss import bursty, independent
from lockstep.bench.emulator.impairment.path import PathStatistics
from lockstep.bench.emulator.impairment.profile import Profile, even_profile, load_profile, parse_profile, profile_names
from lockstep.bench.emulator.namespace.network_process import NetworkProcess
from lockstep.bench.emulator.network import Network
from lockstep.bench.emulator.network_statistics import NetworkStatistics, QueueStatistics

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
