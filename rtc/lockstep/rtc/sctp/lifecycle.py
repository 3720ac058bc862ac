"""The state of an association, from its handshake to its end (RFC 9260 4)."""

from enum import Enum

from lockstep.rtc.sctp.events import Closed
from lockstep.rtc.sctp.wire.chunks import Abort
from lockstep.rtc.sctp.wire.parameters import USER_ABORT

__all__ = ["Lifecycle", "State"]


class State(Enum):
    """The states of RFC 9260 4."""

    CLOSED = "closed"
    COOKIE_WAIT = "cookie-wait"
    COOKIE_ECHOED = "cookie-echoed"
    ESTABLISHED = "established"
    SHUTDOWN_PENDING = "shutdown-pending"
    SHUTDOWN_SENT = "shutdown-sent"
    SHUTDOWN_RECEIVED = "shutdown-received"
    SHUTDOWN_ACK_SENT = "shutdown-ack-sent"


_UP = frozenset({State.ESTABLISHED, State.SHUTDOWN_PENDING, State.SHUTDOWN_RECEIVED, State.SHUTDOWN_SENT})
_CAN_RECEIVE = frozenset({State.COOKIE_ECHOED, State.ESTABLISHED, State.SHUTDOWN_PENDING, State.SHUTDOWN_SENT})


class Lifecycle:
    """What the state permits. `closed` is None until the end, after which nothing changes any more."""

    def __init__(self) -> None:
        self.state = State.CLOSED
        self.is_up = False  # the handshake is done, and chunks other than those of a shutdown may leave
        self.may_receive = False  # messages
        self.closed: Closed | None = None

    def become(self, state: State) -> None:
        self.state = state
        self.is_up = state in _UP
        self.may_receive = state in _CAN_RECEIVE

    def end(self, reason: str, detail: str = "") -> None:
        self.become(State.CLOSED)
        self.closed = Closed(reason, detail)

    def receive_abort(self, chunk: Abort, now: float) -> None:
        causes = [kind for kind, _ in chunk.causes]
        reason = "peer_closed" if USER_ABORT in causes else "peer_aborted"
        self.end(reason, " ".join(f"cause {cause}" for cause in causes[:8]))
