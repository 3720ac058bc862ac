"""Lets another Python, such as that of a ROS installation, find the bridge's code, and not the packages beside it.

Those packages are for another version of Python, and would hide that Python's own.
"""

import os
from collections.abc import Mapping
from pathlib import Path

import lockstep.protocol
import lockstep.robot_bridge

__all__ = ["link_packages", "with_packages"]


def link_packages(directory: Path) -> None:
    """Make a folder with the bridge's packages alone, as links."""
    namespace = directory / "lockstep"
    namespace.mkdir()
    for part in (lockstep.protocol, lockstep.robot_bridge):
        package = Path(part.__path__[0]).resolve()
        (namespace / package.name).symlink_to(package, target_is_directory=True)


def with_packages(environment: Mapping[str, str], directory: str) -> dict[str, str]:
    """Return the environment for a Python that finds the packages in the folder, after those of its own PYTHONPATH."""
    paths = (environment.get("PYTHONPATH", ""), directory)
    return {**environment, "PYTHONPATH": os.pathsep.join(filter(None, paths))}
