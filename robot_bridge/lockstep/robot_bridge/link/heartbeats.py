"""The pings of one side of a link, and how long the other may be silent. No I/O, no clock."""

from collections import OrderedDict

from lockstep.protocol.messages import Ping

__all__ = ["PING_INTERVAL", "SILENCE", "Heartbeats"]

PING_INTERVAL = 0.2  # s
SILENCE = 1.0  # s without a valid message, and `ROUND_TRIPS` more, after which the other side is taken for dead
ROUND_TRIPS = 4  # in which TCP has found out about a loss and repaired it, though the repair may be lost too
MOST_SILENCE = 5.0  # s, even when the other side lengthens the round trip by late pongs
PINGS_OUT = 64  # pings without a pong whose time of sending is remembered


class Heartbeats:
    """Call `ping` at intervals, and `pong` with each answer."""

    def __init__(self, now: float) -> None:
        self._last_ping = now
        self._ping_id = 0
        self._pings: OrderedDict[int, float] = OrderedDict()  # id -> when it was sent, of those without a pong
        self._round_trip = 0.0  # s, smoothed; 0 before it was measured

    @property
    def patience(self) -> float:
        """The seconds of silence after which the other side is taken for dead.

        A loss holds back everything behind it until TCP has repeated it, which takes round trips: on a long path a link
        that waited for only a second would end with nearly every loss.
        """
        return min(SILENCE + ROUND_TRIPS * self._round_trip, MOST_SILENCE)

    def ping(self, now: float) -> Ping | None:
        """Return the ping to send now; None while none is due."""
        return None if now - self._last_ping < PING_INTERVAL else self.ping_early(now)

    def ping_early(self, now: float) -> Ping:
        """Return a ping that is sent before one is due; the next is due later by as much."""
        self._last_ping = now
        self._ping_id += 1
        self._pings[self._ping_id] = now
        if len(self._pings) > PINGS_OUT:
            self._pings.popitem(last=False)
        return Ping(id=self._ping_id)

    def pong(self, id: int, now: float) -> None:
        """Take the answer to a ping; an answer to none says nothing of the path."""
        sent = self._pings.pop(id, None)
        if sent is not None:
            self.measured(now - sent)

    def measured(self, round_trip: float) -> None:
        """Smooth one more round trip, s, into the mean, as TCP does (RFC 6298 2.3)."""
        before = self._round_trip
        self._round_trip = round_trip if before == 0.0 else before + (round_trip - before) / 8
