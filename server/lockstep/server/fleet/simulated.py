"""The names and files of several simulated robots of one console. No I/O."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from lockstep.server.util.robot_names import check_names

__all__ = ["own_event_log", "own_state_dir", "simulated_robots"]


def simulated_robots(given: Sequence[str]) -> dict[str, str]:
    """Return the kinds of robots by name. One without a name is the only robot of a console: its name is "".

    Several are "left=planar", or "planar" alone, which is then its name; the second is "planar-2".

    Raises:
        BadFleet: a name is invalid, or is given twice.
    """
    if len(given) == 1 and "=" not in given[0]:
        return {"": given[0]}
    named = [(name.strip(), kind.strip()) for name, _, kind in (each.rpartition("=") for each in given)]
    check_names(name for name, _ in named if name)
    taken = {name for name, _ in named if name}
    numbers: Counter[str] = Counter()
    found: dict[str, str] = {}
    for name, kind in named:
        if not name:
            name = _free(kind, numbers, taken)
            taken.add(name)
        found[name] = kind
    check_names(found)
    return found


def _free(kind: str, numbers: Counter[str], taken: set[str]) -> str:
    while True:
        numbers[kind] += 1
        name = kind if numbers[kind] == 1 else f"{kind}-{numbers[kind]}"
        if name not in taken:
            return name


def own_state_dir(state_dir: Path, robot: str) -> Path:
    """Return the directory in which a robot's bridge keeps its stop, the same for every port of the console.

    `robot`: its name, or without one its kind, or the name of the file that describes it.
    """
    return state_dir / "stops" / robot


def own_event_log(path: Path, robot: str) -> Path:
    """Return the file of a robot's bridge: events-left.jsonl for the robot left."""
    return path if not robot else path.with_name(f"{path.stem}-{robot}{path.suffix}")
