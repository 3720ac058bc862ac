"""Paths of a robot's routes in a fleet: those of a console with one robot, below a prefix. No I/O."""

import re

__all__ = ["ROBOTS", "below_robot"]

ROBOTS = "/robots"
_PREFIX = re.compile(rf"{ROBOTS}/[^/]+(?=/)")


def below_robot(path: str) -> str:
    """Return `path` without a robot's prefix: "/api/stop" for "/robots/left/api/stop", and for itself."""
    found = _PREFIX.match(path)
    return path if found is None else path[found.end() :]
