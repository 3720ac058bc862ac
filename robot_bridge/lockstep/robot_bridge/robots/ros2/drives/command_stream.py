"""Decides when values are published to a command topic. No I/O, no clock.

While the values move the robot they are repeated at a fixed rate, so that a base with its own timeout keeps going; the
bridge's `hold` bounds how long. When they come to rest, for any reason, exactly one zero is published. Then the topic
is silent, and free for other drivers of the robot. When the robot's side is lost, no value is sent until it is back and
the values have been at rest once.
"""

from collections.abc import Sequence
from enum import Enum
from typing import NamedTuple

__all__ = ["CommandStream", "Said", "Step"]


class Said(Enum):
    NOTHING = "nothing"
    VALUES = "values"
    ZERO = "zero"


class Step(NamedTuple):
    said: Said  # to be published now
    values: list[float]  # the robot's motion during this tick, published or not


class CommandStream:
    """The messages of one command topic. Call `step` once a tick."""

    def __init__(self, rate: float, rest_values: Sequence[float], tick_seconds: float) -> None:
        self._interval = 1.0 / rate - tick_seconds / 2  # to the nearest tick
        self._rest = list(rest_values)
        self._last: float | None = None  # s, when moving values were published; None: a zero was the last
        self._withheld = False

    @property
    def withheld(self) -> bool:
        """True if values are kept from the robot because its side was lost."""
        return self._withheld

    def step(self, values: Sequence[float], lost: bool, now: float) -> Step:
        """Return the step of this tick. `lost`: the robot cannot be seen or does not listen."""
        at_rest = list(values) == self._rest
        self._withheld = lost or (self._withheld and not at_rest)
        if at_rest or self._withheld:
            said = Said.ZERO if self._last is not None else Said.NOTHING
            self._last = None
            return Step(said, list(self._rest))
        if self._last is not None and now - self._last < self._interval:
            return Step(Said.NOTHING, list(values))
        self._last = now
        return Step(Said.VALUES, list(values))

    def end(self) -> bool:
        """End the stream because the bridge closes. True if a zero is still owed."""
        owed, self._last = self._last is not None, None
        return owed
