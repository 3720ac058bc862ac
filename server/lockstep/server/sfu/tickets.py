"""Messages that tell an observer its relay and the streams there."""

import msgspec

from lockstep.protocol.console import StreamInfo

__all__ = ["RelayAnswer", "RelayTicket", "without_key"]


class RelayTicket(msgspec.Struct, frozen=True, kw_only=True, tag_field="engine", tag="janus"):
    """All that an observer needs to watch, and nothing that would let anybody publish or change the room."""

    relay: str  # its number here; for POST /whep?relay=
    url: str  # WebSocket
    room: int
    pin: str  # opens the room; "" for a client that takes no part in the session yet
    feed: int  # the publisher to subscribe to; another one with every publication
    streams: list[StreamInfo]  # `mid` is the publisher's


class RelayAnswer(msgspec.Struct, frozen=True):
    """Answer of GET /api/relay."""

    relay: RelayTicket | None  # None: connect to the console for media too


def without_key(ticket: RelayTicket) -> RelayTicket:
    """Return the ticket without the pin that opens the room."""
    return msgspec.structs.replace(ticket, pin="")
