"""What several simulated robots of one console are called. No I/O."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from lockstep.server.util.robot_names import check_names

__all__ = ["own_event_log", "own_state_dir", "simulated_robots"]


def simulated_robots(given: Sequence[str]) -> dict[str, str]:
    """Kinds of robots by name. One that is not named is the only robot of a console: its name is "".

    Several are "left=planar", or "planar" alone, which is then its name; the second is "planar-2".

    Raises:
        BadFleet: a name is no good, or is given twice.
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
    """Where a robot's bridge keeps its stop: with the robot, whatever port the console has.

    `robot`: its name, or what it is called that has none: its kind, or the file that describes it.
    """
    return state_dir / "stops" / robot


def own_event_log(path: Path, robot: str) -> Path:
    """Each bridge has a file of its own: events-left.jsonl for the robot left."""
    return path if not robot else path.with_name(f"{path.stem}-{robot}{path.suffix}")
