"""Measures the round trip where no message can (RFC 9260 8.3)."""

from struct import Struct

from lockstep.rtc.sctp.lifecycle import Lifecycle
from lockstep.rtc.sctp.packets import Packets
from lockstep.rtc.sctp.sending.round_trip import RoundTrip
from lockstep.rtc.sctp.wire.chunks import Heartbeat, HeartbeatAck
from lockstep.rtc.sctp.wire.parameters import encode_parameters

__all__ = ["Heartbeats"]

INFO = 1  # RFC 9260 3.3.5
LOST_AFTER = 5.0  # s; then another one may be sent

_number = Struct("!Q")


class Heartbeats:
    """Sends one HEARTBEAT at a time, and answers the peer's. Karn's rule leaves no sample where everything is repeated:
    on a path whose round trip is longer than the timeout, everything would be repeated for ever. An answer to a
    HEARTBEAT belongs to it alone."""

    def __init__(self, lifecycle: Lifecycle, packets: Packets, round_trip: RoundTrip) -> None:
        self._lifecycle = lifecycle
        self._packets = packets
        self._round_trip = round_trip
        self._count = 0
        self._awaited_info = b""
        self._sent_at = 0.0

    def ask(self, now: float) -> None:
        """Send a HEARTBEAT, unless another is under way."""
        if self._awaited_info and now - self._sent_at < LOST_AFTER:
            return
        self._count += 1
        self._awaited_info = encode_parameters([(INFO, _number.pack(self._count))])
        self._sent_at = now
        self._packets.control.append(Heartbeat(self._awaited_info).encode())

    def receive(self, chunk: Heartbeat, now: float) -> None:
        if self._lifecycle.is_up:
            self._packets.answer(HeartbeatAck(chunk.body))

    def receive_ack(self, chunk: HeartbeatAck, now: float) -> None:
        if self._awaited_info and chunk.body == self._awaited_info:
            self._awaited_info = b""
            self._round_trip.sample(now - self._sent_at, now)
