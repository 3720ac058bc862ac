"""Rates by a dataset's rows, and its drivers' commands by its notes. No I/O.

The time from one row of an episode to the next is its first row's: that row's command was executed then. Of a pause
`LONGEST` counts, as in `driver_figures`. Rows may leave events out, so events are counted by their numbers.
"""

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, TypeVar

from lockstep.protocol.console import DriverKind
from lockstep.protocol.serial import event_gap
from lockstep.server.recording.export.episode_commands import DriverCommands
from lockstep.server.recording.export.lerobot_meta import DatasetEpisode
from lockstep.server.recording.reading.samples import percentile_of
from lockstep.server.recording.report.driver_figures import LONGEST

__all__ = ["Driver", "Rate", "Row", "SummedCommands", "commands_by_driver", "driver_of", "event_rates", "picture_rate"]

Row = dict[str, Any]
Driver = tuple[str, DriverKind]
Key = TypeVar("Key")


@dataclass
class Rate:
    """How often something came in the time in which somebody drove."""

    count: int = 0
    seconds: float = 0.0

    @property
    def hertz(self) -> float | None:
        """None: nobody drove."""
        return self.count / self.seconds if self.seconds > 0 else None


@dataclass
class SummedCommands:
    """The commands of a driver in several episodes."""

    delays: Counter[float] = field(default_factory=Counter)  # number by ms, in two digits
    refused: Counter[str] = field(default_factory=Counter)  # number by reason

    def delay(self, share: float) -> float | None:
        """Return the ms to the feedback that `share` (0 to 1) of the commands do not exceed; None without any."""
        return percentile_of(self.delays, share)

    def add(self, commands: DriverCommands) -> None:
        self.delays.update(commands.delays)
        self.refused.update(commands.refused)


def driver_of(row: Row) -> Driver:
    return row["lockstep.driver"], row["lockstep.driver_kind"]


def event_rates(rows: Iterable[Row], key: Callable[[Row], Key]) -> dict[Key, Rate]:
    """Return the executed events a second. `key`: of a row, what the rates are told by."""
    found: dict[Key, Rate] = defaultdict(Rate)
    for row, after, seconds in _intervals(rows):
        rate = found[key(row)]
        rate.count += max(0, event_gap(after["lockstep.event"], row["lockstep.event"]))
        rate.seconds += seconds
    return found


def picture_rate(rows: Iterable[Row], stamp_of: Callable[[Row], int]) -> Rate:
    """Return the new pictures a second of a camera: those with another stamp than the row before."""
    found = Rate()
    for row, after, seconds in _intervals(rows):
        found.count += stamp_of(after) != stamp_of(row)
        found.seconds += seconds
    return found


def commands_by_driver(
    episodes: Sequence[DatasetEpisode], driven: Iterable[tuple[int, Driver]]
) -> dict[Driver, SummedCommands]:
    """Return the commands of all drivers of whom the notes tell.

    Args:
        driven: who has a row in which episode. A driver of whom the episode's notes tell nothing was refused nothing.
    """
    found: dict[Driver, SummedCommands] = defaultdict(SummedCommands)
    for each in episodes:
        for commands in each.commands.drivers if each.commands is not None else ():
            found[commands.name, commands.kind].add(commands)
    for index, driver in driven:
        if episodes[index].commands is not None:
            found.setdefault(driver, SummedCommands())
    return found


def _intervals(rows: Iterable[Row]) -> Iterator[tuple[Row, Row, float]]:
    """Yield rows of an episode that follow each other, with the s from one to the other that count."""
    for row, after in pairwise(rows):
        if row["episode_index"] == after["episode_index"]:
            seconds = after["lockstep.time"] - row["lockstep.time"]
            yield row, after, min(max(0.0, seconds), LONGEST)
