"""Outages, in which nothing passes: on a schedule, and on demand. No I/O."""

import math
from dataclasses import dataclass
from typing import NamedTuple

__all__ = ["Outages", "PlannedOutage", "Silence"]


@dataclass(frozen=True)
class PlannedOutage:
    """An outage of the schedule. Times in seconds; the schedule's clock starts with `Outages.start`."""

    at: float
    lasts: float
    every: float | None = None  # from the start of one to the start of the next; None: once
    hold: bool = False  # packets wait in the network until it is over; else they are lost


class Silence(NamedTuple):
    """An outage that holds now."""

    until: float
    hold: bool


class Outages:
    """The outages of one place, shared by all paths that lead through it."""

    def __init__(self, planned: tuple[PlannedOutage, ...] = ()) -> None:
        self._planned = planned
        self._started: float | None = None
        self._demanded = Silence(0.0, False)
        self._demanded_at = 0.0

    @property
    def started(self) -> bool:
        return self._started is not None

    def start(self, now: float) -> None:
        """Start the schedule, or start it again from its beginning."""
        self._started = now

    def demand(self, now: float, seconds: float, *, hold: bool = False) -> None:
        """Begin an outage now; it replaces the one demanded before."""
        self._demanded = Silence(now + seconds, hold)
        self._demanded_at = now

    def at(self, now: float) -> Silence | None:
        """Return the outage that holds at `now`; of several the one that lasts longest."""
        found = self._demanded if self._demanded_at <= now < self._demanded.until else None
        if self._started is not None:
            for planned in self._planned:
                silence = _holding(planned, now - self._started, self._started)
                if silence is not None and (found is None or silence.until > found.until):
                    found = silence
        return found

    def planned_seconds(self, began: float, ended: float) -> float:
        """Return for how long outages of the schedule held between two times; of several at once the sum."""
        if self._started is None:
            return 0.0
        return sum(_overlap(planned, began - self._started, ended - self._started) for planned in self._planned)


def _overlap(planned: PlannedOutage, began: float, ended: float) -> float:
    rounds = [0]
    if planned.every is not None:
        first = max(0, math.floor((began - planned.at) / planned.every))
        rounds = list(range(first, max(first, math.ceil((ended - planned.at) / planned.every)) + 1))
    starts = [planned.at + number * (planned.every or 0.0) for number in rounds]
    return sum(max(0.0, min(ended, start + planned.lasts) - max(began, start)) for start in starts)


def _holding(planned: PlannedOutage, passed: float, started: float) -> Silence | None:
    since = passed - planned.at
    rounds = 0
    if since >= 0 and planned.every is not None:
        rounds = int(since // planned.every)
        since -= rounds * planned.every
    if not 0 <= since < planned.lasts:
        return None
    return Silence(started + planned.at + rounds * (planned.every or 0.0) + planned.lasts, planned.hold)
