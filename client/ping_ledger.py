"""Pings that are out: the round trip, and which of them were lost. No I/O."""

import itertools
from collections import OrderedDict

__all__ = ["PingLedger"]

LOST_AFTER = 1.0  # s


class PingLedger:
    """Call `send` for each ping, `answered` for each pong, `lost` now and then."""

    def __init__(self) -> None:
        self.round_trip: float | None = None  # s, of the last answered ping
        self._out: OrderedDict[int, float] = OrderedDict()
        self._ids = itertools.count(1)

    def send(self, now: float) -> int:
        """The id of the ping to send now."""
        number = next(self._ids)
        self._out[number] = now
        return number

    def answered(self, number: int, now: float) -> float | None:
        """The round trip; None for a pong that answers nothing."""
        sent_at = self._out.pop(number, None)
        if sent_at is None:
            return None
        self.round_trip = now - sent_at
        return self.round_trip

    def lost(self, now: float) -> int:
        """How many pings have become lost since the last call."""
        count = 0
        while self._out and next(iter(self._out.values())) < now - LOST_AFTER:
            self._out.popitem(last=False)
            count += 1
        return count
