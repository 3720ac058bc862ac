"""Judges a bridge's own record: finds what must never have happened. No I/O."""

from collections.abc import Iterable, Mapping
from typing import Any

__all__ = ["Judge", "Verdict"]

LOG_TOLERANCE = 0.02  # s between a decision and its line in the record


class Verdict(dict[str, int]):
    """Counts by name: executed_twice, executed_late, moved_without_seat, moved_while_stopped, executed, epochs."""


class Judge:
    """Reads the records in the order in which they were written, over any number of epochs.

    Args:
        max_event_age: s, of the robot's description
        hold: s, in which a stopped robot comes to rest
        axis: index of the axis that only those drive backwards who do not hold the seat
    """

    def __init__(self, max_event_age: float, hold: float, axis: int = 0) -> None:
        self._max_event_age = max_event_age
        self._hold = hold
        self._axis = axis
        self._executed: set[int] = set()
        self._issued: dict[tuple[int, int], float] = {}  # feedback (event, issue) → when
        self._stopped_at: float | None = None
        self.verdict = Verdict(
            executed_twice=0, executed_late=0, moved_without_seat=0, moved_while_stopped=0, executed=0, epochs=0
        )

    def read(self, records: Iterable[Mapping[str, Any]]) -> None:
        for record in records:
            match record["kind"]:
                case "start":
                    self._begin_epoch()
                case "feedback":
                    self._feedback(record)
                case "executed":
                    self._execution(record)
                case "stop":
                    self._stopped_at = record["time"] if self._stopped_at is None else self._stopped_at
                case "reset":
                    self._stopped_at = None

    def _begin_epoch(self) -> None:
        self.verdict["epochs"] += 1
        self._executed.clear()
        self._issued.clear()
        self._stopped_at = None

    def _feedback(self, record: Mapping[str, Any]) -> None:
        self._issued[record["event"], record["issue"]] = record["time"]
        since_stop = None if self._stopped_at is None else record["time"] - self._stopped_at
        if since_stop is not None and since_stop > self._hold + LOG_TOLERANCE and not record["at_rest"]:
            self.verdict["moved_while_stopped"] += 1

    def _execution(self, record: Mapping[str, Any]) -> None:
        event, values = record["event"], record["values"]
        self.verdict["executed"] += 1
        self.verdict["executed_twice"] += event in self._executed
        self._executed.add(event)
        issued = self._issued.get((event - 1, record["issue"]))  # a soak is too short for the counter to wrap
        if issued is None or record["time"] - issued > self._max_event_age + LOG_TOLERANCE:
            self.verdict["executed_late"] += 1
        self.verdict["moved_without_seat"] += (values[self._axis] or 0.0) < 0
        self.verdict["moved_while_stopped"] += self._stopped_at is not None
