"""Where a robot's routes lie in a fleet: those of a console with one robot, below a prefix. No I/O."""

import re

__all__ = ["ROBOTS", "below_robot"]

ROBOTS = "/robots"
_PREFIX = re.compile(rf"{ROBOTS}/[^/]+(?=/)")


def below_robot(path: str) -> str:
    """`path` as the robot's own routes have it: "/api/stop" for "/robots/left/api/stop", and for itself."""
    found = _PREFIX.match(path)
    return path if found is None else path[found.end() :]
