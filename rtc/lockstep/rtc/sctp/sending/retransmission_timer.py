"""The times at which chunks that nothing acknowledges are lost (T3-rtx, RFC 9260 6.3)."""

from collections import deque
from collections.abc import Iterator

from lockstep.rtc.sctp.sending.outgoing import IN_FLIGHT, Outgoing
from lockstep.rtc.sctp.sending.round_trip import RoundTrip

__all__ = ["RetransmissionTimer"]

_Sent = deque[tuple[float, Outgoing]]  # as they left, and when


class RetransmissionTimer:
    """One timer for reliable chunks, whose interval grows with `expiries`, and one for newest-wins chunks, which are
    given up after a round trip and the peer's delay."""

    def __init__(self, round_trip: RoundTrip, peer_delay: float) -> None:
        """`peer_delay`: of the peer's acknowledgements, in s."""
        self.expiries = 0  # waits in vain since the last acknowledgement
        self._round_trip = round_trip
        self._peer_delay = peer_delay
        self._newest: _Sent = deque()
        self._reliable: _Sent = deque()  # some may be acknowledged

    def left(self, chunk: Outgoing, now: float) -> None:
        """Note that a chunk leaves."""
        (self._newest if chunk.newest_wins else self._reliable).append((now, chunk))

    def deadline(self, due: float | None) -> float | None:
        """Return the time at which a chunk in flight is lost, or `due` if that comes first."""
        if (left := _first(self._reliable)) is not None:
            expires = left + self._round_trip.timeout(self.expiries)
            due = expires if due is None or expires < due else due
        if (left := _first(self._newest)) is not None:
            expires = left + (self._round_trip.timeout(0) + self._peer_delay)
            due = expires if due is None or expires < due else due
        return due

    def late_newest(self, now: float) -> Iterator[Outgoing]:
        """Yield the newest-wins chunks that are lost."""
        return _late(self._newest, self._round_trip.timeout(0) + self._peer_delay, now)

    def late(self, now: float) -> Iterator[Outgoing]:
        """Yield the reliable chunks that are lost where nothing was waited for in vain before."""
        return _late(self._reliable, self._round_trip.timeout(0), now)

    def expires(self, now: float) -> bool:
        """True if the first reliable chunk was waited for in vain; `expiries` counts that."""
        left = _first(self._reliable)
        if left is None or left + self._round_trip.timeout(self.expiries) > now:
            return False
        self.expiries += 1
        return True

    def clear(self) -> None:
        self._newest.clear()
        self._reliable.clear()


def _late(sent: _Sent, wait: float, now: float) -> Iterator[Outgoing]:
    while (left := _first(sent)) is not None and left + wait <= now:
        yield sent.popleft()[1]


def _first(sent: _Sent) -> float | None:
    """Return the time at which the first of these left that is still in flight."""
    while sent:
        left, chunk = sent[0]
        if chunk.state is IN_FLIGHT and chunk.sent_at == left:
            return left
        sent.popleft()
    return None
