"""The end after which nothing is missing (RFC 9260 9.2): SHUTDOWN, SHUTDOWN ACK and SHUTDOWN COMPLETE."""

from lockstep.rtc.sctp.data_transfer import DataTransfer
from lockstep.rtc.sctp.lifecycle import Lifecycle, State
from lockstep.rtc.sctp.packets import Packets
from lockstep.rtc.sctp.sending.round_trip import RoundTrip
from lockstep.rtc.sctp.serial import MASK_32
from lockstep.rtc.sctp.wire.chunks import Shutdown, ShutdownAck, ShutdownComplete

__all__ = ["GracefulShutdown"]


class GracefulShutdown:
    """Ends the association when everything has arrived. `repeat_at` is the time at which `handle_timer` is due (T2)."""

    def __init__(self, lifecycle: Lifecycle, packets: Packets, transfer: DataTransfer, round_trip: RoundTrip) -> None:
        self.repeat_at: float | None = None
        self._lifecycle = lifecycle
        self._packets = packets
        self._transfer = transfer
        self._round_trip = round_trip
        self._repeats = 0

    def begin(self, now: float) -> bool:
        """Begin it at this end. Return True if the association has ended, because it was not up yet."""
        state = self._lifecycle.state
        if state is State.ESTABLISHED:
            self._lifecycle.become(State.SHUTDOWN_PENDING)
            self.go_on(now)
        elif state in (State.CLOSED, State.COOKIE_WAIT, State.COOKIE_ECHOED):
            self._lifecycle.end("closed")
            return True
        return False

    def go_on(self, now: float) -> None:
        """Send SHUTDOWN, or the answer to it, when everything has arrived."""
        self._transfer.take_late_sack()
        if not self._transfer.sender.idle:
            return
        if self._lifecycle.state is State.SHUTDOWN_PENDING:
            self._lifecycle.become(State.SHUTDOWN_SENT)
        elif self._lifecycle.state is State.SHUTDOWN_RECEIVED:
            self._lifecycle.become(State.SHUTDOWN_ACK_SENT)
        else:
            return
        self._repeats = 0
        self._send(now)

    def handle_timer(self, now: float) -> None:
        """Repeat the chunk if T2 has expired."""
        if self.repeat_at is not None and now >= self.repeat_at:
            self._repeats += 1
            self._send(now)

    def _send(self, now: float) -> None:
        cumulative = self._transfer.receiver.received.cumulative
        is_first = self._lifecycle.state is State.SHUTDOWN_SENT
        self._packets.control.append((Shutdown(cumulative & MASK_32) if is_first else ShutdownAck()).encode())
        self.repeat_at = now + self._round_trip.timeout(self._repeats)

    def receive_shutdown(self, chunk: Shutdown, now: float) -> None:
        if self._lifecycle.state in (
            State.ESTABLISHED,
            State.SHUTDOWN_PENDING,
            State.SHUTDOWN_SENT,
        ):  # last: both at once
            self._lifecycle.become(State.SHUTDOWN_RECEIVED)
            self.go_on(now)

    def receive_shutdown_ack(self, chunk: ShutdownAck, now: float) -> None:
        if self._lifecycle.state in (State.SHUTDOWN_SENT, State.SHUTDOWN_ACK_SENT):
            self._packets.send_alone(self._packets.peer_tag, ShutdownComplete())
            self._lifecycle.end("closed")

    def receive_shutdown_complete(self, chunk: ShutdownComplete, now: float) -> None:
        if self._lifecycle.state is State.SHUTDOWN_ACK_SENT:
            self._lifecycle.end("peer_closed")
