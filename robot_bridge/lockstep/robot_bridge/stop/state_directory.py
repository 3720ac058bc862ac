"""Where a robot's latched stop is kept by default. A latch belongs to the robot, so its place has the robot's name.

No port is in it: the same robot on another port, or on any free one, has the same latch. Two bridges of one robot
cannot run at once; two robots of one kind are told apart by `--state-dir`.
"""

import os
from collections.abc import Sequence
from pathlib import Path

__all__ = ["default_place", "older_places"]

FOLDER = "stops"
OLDER_FOLDER = "bridges"  # where a place had the port behind its name, "planar-5600"


def default_place(robot: str) -> Path:
    """By the XDG base directory specification. `robot`: its name, or that of the file that describes it."""
    base = os.environ.get("XDG_STATE_HOME", "")
    return (Path(base) if os.path.isabs(base) else Path("~/.local/state").expanduser()) / "lockstep" / FOLDER / robot


def older_places(place: Path, names: Sequence[str]) -> tuple[Path, ...]:
    """Places of the robot from when they were named by port. `names`: that the robot had.

    A bridge that finds no state in `place` begins with the state in these.
    """
    if place.parent.name != FOLDER:
        return ()
    older = place.parent.with_name(OLDER_FOLDER)
    try:
        return tuple(sorted(each for each in older.iterdir() if _is_of(each.name, names) and each.is_dir()))
    except (FileNotFoundError, NotADirectoryError):
        return ()


def _is_of(folder: str, names: Sequence[str]) -> bool:
    name, _, port = folder.rpartition("-")
    return name in names and port.isascii() and port.isdigit()
