"""Measures the round trip where no message can (RFC 9260 8.3)."""

from struct import Struct

from lockstep.rtc.sctp.wire.chunks import Heartbeat, HeartbeatAck
from lockstep.rtc.sctp.wire.parameters import encode_parameters

__all__ = ["Heartbeats"]

INFO = 1  # RFC 9260 3.3.5
LOST_AFTER = 5.0  # s; then another one may be sent

_number = Struct("!Q")


class Heartbeats:
    """Sends one HEARTBEAT at a time. Karn's rule leaves no sample where everything is repeated: on a path whose round
    trip is longer than the timeout, everything would be repeated for ever. An answer to a HEARTBEAT belongs to it
    alone."""

    def __init__(self) -> None:
        self._count = 0
        self._waits_for = b""
        self._sent_at = 0.0

    def ask(self, now: float) -> Heartbeat | None:
        """Return a HEARTBEAT to send; None while another is under way."""
        if self._waits_for and now - self._sent_at < LOST_AFTER:
            return None
        self._count += 1
        self._waits_for = encode_parameters([(INFO, _number.pack(self._count))])
        self._sent_at = now
        return Heartbeat(self._waits_for)

    def answered(self, chunk: HeartbeatAck, now: float) -> float | None:
        """Return the round trip in seconds; None if this answers no HEARTBEAT that is under way."""
        if not self._waits_for or chunk.body != self._waits_for:
            return None
        self._waits_for = b""
        return now - self._sent_at
