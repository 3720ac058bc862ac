"""Keeps the pings that are not answered yet: their round trip, and the lost ones. No I/O."""

import itertools
from collections import OrderedDict

__all__ = ["PingLedger"]

LOST_AFTER = 1.0  # s, at least
LOST_TRIPS = 2  # round trips after which a ping counts as lost on a long path
LOST_UNKNOWN = 3.0  # s, before the first answer
FORGOTTEN = 10.0  # s; until then a late answer still tells the round trip


class PingLedger:
    """Measures round trips and losses. Call `send` for each ping, `answered` for each pong, `lost` now and then."""

    def __init__(self) -> None:
        self.round_trip: float | None = None  # s, of the last answered ping
        self._out: OrderedDict[int, float] = OrderedDict()
        self._ids = itertools.count(1)
        self._counted = 0  # pings up to this one were counted, if lost

    def send(self, now: float) -> int:
        """Return the id of the ping to send now."""
        number = next(self._ids)
        self._out[number] = now
        return number

    def answered(self, number: int, now: float) -> float | None:
        """Return the round trip in s; None for a pong that answers nothing."""
        sent_at = self._out.pop(number, None)
        if sent_at is None:
            return None
        self.round_trip = now - sent_at
        return self.round_trip

    def lost(self, now: float) -> int:
        """Return the number of pings lost since the last call. A later answer still tells the round trip."""
        limit = LOST_UNKNOWN if self.round_trip is None else max(LOST_AFTER, LOST_TRIPS * self.round_trip)
        overdue = [number for number, sent_at in self._out.items() if sent_at < now - limit]
        count = sum(number > self._counted for number in overdue)
        self._counted = max([self._counted, *overdue])
        while self._out and next(iter(self._out.values())) < now - FORGOTTEN:
            self._out.popitem(last=False)
        return count
