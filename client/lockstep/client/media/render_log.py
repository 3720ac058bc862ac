"""Logs of the newest renderings and feedbacks, for tests, measurements and the operator's own tools. No I/O."""

from collections import deque
from typing import NamedTuple

__all__ = ["FeedbackArrival", "RenderLog", "Rendering"]

LIMIT = 1000


class Rendering(NamedTuple):
    """One picture or segment of sound that passed the gate."""

    at: float  # s, the loop's clock
    stamp: int | None
    gap: int | None
    feedback: int | None  # newest event at that moment
    age: float | None  # s since its capture by synchronised clocks; None when the carrier does not say


class FeedbackArrival(NamedTuple):
    at: float  # s, the loop's clock
    event: int


class RenderLog:
    """The last `LIMIT` renderings of one stream."""

    def __init__(self) -> None:
        self._entries: deque[Rendering] = deque(maxlen=LIMIT)

    def add(self, entry: Rendering) -> None:
        self._entries.append(entry)

    def all(self) -> list[Rendering]:
        """Return the renderings, oldest first."""
        return list(self._entries)
