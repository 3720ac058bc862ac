"""A chunk on its way out, from its TSN to its acknowledgement."""

from enum import Enum

from lockstep.rtc.sctp.sending.send_queue import Message

__all__ = ["ABANDONED", "ACKNOWLEDGED", "IN_FLIGHT", "WAITING", "Outgoing"]


class _State(Enum):
    WAITING = 1  # to be sent, for the first time or again
    IN_FLIGHT = 2
    ACKNOWLEDGED = 3
    ABANDONED = 4


WAITING, IN_FLIGHT = _State.WAITING, _State.IN_FLIGHT
ACKNOWLEDGED, ABANDONED = _State.ACKNOWLEDGED, _State.ABANDONED


class Outgoing:
    """A chunk with a TSN, which lives until everything up to it is acknowledged."""

    __slots__ = (
        "flags",
        "fragment",
        "message",
        "misses",
        "newest_wins",
        "payload",
        "reported",
        "sent_at",
        "sent_count",
        "size",
        "state",
        "tsn",
    )

    def __init__(self, tsn: int, flags: int, message: Message, fragment: int, payload: bytes, newest: bool) -> None:
        self.tsn = tsn  # unwrapped
        self.flags = flags
        self.message = message
        self.fragment = fragment
        self.payload = payload
        self.newest_wins = newest
        self.size = len(payload)
        self.state = WAITING
        self.sent_at = 0.0
        self.sent_count = 0
        self.misses = 0
        self.reported = 0  # number of the last SACK that named it in a gap block
