"""A network in a box: impairs what passes between a client, the console and the robot. docs/networks.md tells how."""

from bench.emulator.errors import BadDescription, EmulatorError, NamespacesUnavailable, ProfileError
from bench.emulator.network import Network
from bench.emulator.network_statistics import NetworkStatistics, QueueStatistics
from bench.emulator.path import PathStatistics
from bench.emulator.profile import Profile, load_profile, parse_profile, profile_names

__all__ = [
    "BadDescription",
    "EmulatorError",
    "NamespacesUnavailable",
    "Network",
    "NetworkStatistics",
    "PathStatistics",
    "Profile",
    "ProfileError",
    "QueueStatistics",
    "load_profile",
    "parse_profile",
    "profile_names",
]
