"""Emulates a network between a client, the console and the robot. docs/networks.md describes it."""

from lockstep.emulator.errors import BadDescription, EmulatorError, NamespacesUnavailable, ProfileError
from lockstep.emulator.impairment.delay import Constant, Lognormal, Normal, Pareto, Uniform
from lockstep.emulator.impairment.impairment import Impairment, Reordering
from lockstep.emulator.impairment.loss import bursty, independent
from lockstep.emulator.impairment.path import PathStatistics
from lockstep.emulator.impairment.profile import Profile, even_profile, load_profile, parse_profile, profile_names
from lockstep.emulator.namespace.network_process import NetworkProcess
from lockstep.emulator.network import Network
from lockstep.emulator.network_statistics import NetworkStatistics, QueueStatistics

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
