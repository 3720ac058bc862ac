"""Keeps the newest message of a topic, and tells whether it is recent. No I/O, no clock."""

from collections import Counter
from dataclasses import dataclass
from typing import Generic, TypeVar

__all__ = ["Arrived", "Newest"]

Value = TypeVar("Value")
BAD_SHOWN = 3.0  # s for which a fault is shown after the last bad message


@dataclass(frozen=True)
class Arrived(Generic[Value]):
    value: Value
    time: float  # s, monotonic, suspended time included
    header: int  # ns of the header's stamp; 0: it has none


class Newest(Generic[Value]):
    """The newest message. One thread writes it, the bridge's loop reads it: one reference changes at a time.

    A message that repeats its predecessor's header stamp brings nothing new: a driver that hangs may go on sending.
    """

    def __init__(self, topic: str, timeout: float) -> None:
        self.topic = topic
        self.timeout = timeout
        self.bad: Counter[str] = Counter()  # by fault
        self._last: Arrived[Value] | None = None
        self._bad: tuple[str, float] | None = None  # fault and time of the last bad message

    def put(self, value: Value, now: float, header: int = 0) -> bool:
        """Keep a message. False if it only repeats the last one."""
        last = self._last
        if last is not None and header != 0 and header == last.header:
            return False
        self._last = Arrived(value, now, header)
        return True

    def refuse(self, what: str, now: float) -> None:
        """Count a message that cannot be used."""
        self.bad[what] += 1
        self._bad = (what, now)

    def last(self) -> Arrived[Value] | None:
        """Return the newest message, however old it is; None before the first."""
        return self._last

    def fresh(self, now: float) -> Arrived[Value] | None:
        """Return the newest message; None if it is too old to be taken for the present."""
        last = self._last
        return last if last is not None and now - last.time <= self.timeout else None

    def faults(self, now: float) -> list[str]:
        """Return the faults of this topic, in words for a person."""
        found = []
        last, bad = self._last, self._bad
        if last is None:
            found.append(f"{self.topic}: no message has arrived yet")
        elif now - last.time > self.timeout:
            found.append(f"{self.topic}: no message for {now - last.time:.1f} s")
        if bad is not None and now - bad[1] <= BAD_SHOWN:
            found.append(f"{self.topic}: {self.bad[bad[0]]} × {bad[0]}")
        return found
