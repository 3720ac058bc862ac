"""The default directory of a robot's latched stop, which has the robot's name because the latch belongs to the robot.

The directory's name has no port: the same robot on another port, or on any free one, has the same latch. Two bridges of
one robot cannot run at once; two robots of the same kind need `--state-dir` to be told apart.
"""

import os
from collections.abc import Sequence
from pathlib import Path

__all__ = ["default_place", "older_places"]

FOLDER = "stops"
OLDER_FOLDER = "bridges"  # older directories had the port behind the robot's name, "planar-5600"


def default_place(robot: str) -> Path:
    """Return the directory by the XDG base directory specification.

    `robot`: the robot's name, or the name of the file that describes it.
    """
    base = os.environ.get("XDG_STATE_HOME", "")
    return (Path(base) if os.path.isabs(base) else Path("~/.local/state").expanduser()) / "lockstep" / FOLDER / robot


def older_places(place: Path, names: Sequence[str]) -> tuple[Path, ...]:
    """Return the robot's directories from when they were named by port. `names`: all names that the robot had.

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
