"""Checks that a robot's events go on: counts the left-out numbers and measures the longest pause. No I/O."""

from collections.abc import Iterable

from lockstep.bench.harness.event_log import Record

__all__ = ["Progress"]


class Progress:
    """Reads a bridge's records in order, over any number of its lives.

    Within a life the driver drives all the time, so every pause is a disturbance; between two lives there is no robot.

    Attributes:
        skipped: events whose number did not follow the one before
        longest_pause: s between two events of one life
        pause_ended: end of that pause, on the clock of the record
    """

    def __init__(self) -> None:
        self.skipped = 0
        self.longest_pause = 0.0
        self.pause_ended = 0.0
        self._last: tuple[int, float] | None = None  # event and time; None: this life has none yet

    def read(self, records: Iterable[Record]) -> None:
        for record in records:
            if record["kind"] == "start":
                self._last = None
            elif record["kind"] == "executed":
                self._executed(record["event"], record["time"])

    def _executed(self, event: int, time: float) -> None:
        if self._last is not None:
            number, before = self._last
            self.skipped += event != number + 1  # no run is long enough for the counter to wrap
            if time - before > self.longest_pause:
                self.longest_pause, self.pause_ended = time - before, time
        self._last = (event, time)
