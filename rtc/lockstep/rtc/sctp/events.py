"""The events of an association for its owner."""

from dataclasses import dataclass
from typing import NamedTuple

__all__ = ["Closed", "Established", "Event", "MessageReceived", "OutgoingStreamsReset", "StreamsReset"]


@dataclass(frozen=True, slots=True)
class Established:
    """The handshake is done: both ends know each other."""

    streams: int  # the peer takes messages on streams below this number
    interleaving: bool  # RFC 8260 is in use


class MessageReceived(NamedTuple):
    """A whole message. (A tuple, because there are many: a frozen dataclass takes four times as long to make.)"""

    stream: int
    protocol: int  # PPID
    payload: bytes


@dataclass(frozen=True, slots=True)
class StreamsReset:
    """The peer has reset its outgoing streams: no message arrives on them until they begin anew (RFC 6525 5.2.2)."""

    streams: tuple[int, ...]  # empty: all


@dataclass(frozen=True, slots=True)
class OutgoingStreamsReset:
    """The peer has answered `Association.reset_streams`."""

    streams: tuple[int, ...]
    done: bool  # False: it refused


@dataclass(frozen=True, slots=True)
class Closed:
    """The association has ended; the last event.

    `reason` is a stable name: `closed` and `aborted` by the owner, `peer_closed`, `peer_aborted`, `peer_restarted`, or
    the protocol error that ended it: `receive_window_exceeded`, `message_too_large`, `empty_data`,
    `interleaving_violated`, `init_invalid`.
    """

    reason: str
    detail: str = ""


Event = Established | MessageReceived | StreamsReset | OutgoingStreamsReset | Closed
