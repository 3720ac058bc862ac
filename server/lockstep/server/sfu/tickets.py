"""What an observer is told who watches through a relay: where, and what is there."""

import msgspec

from lockstep.protocol.console import StreamInfo

__all__ = ["RelayAnswer", "RelayTicket", "without_key"]


class RelayTicket(msgspec.Struct, frozen=True, kw_only=True, tag_field="engine", tag="janus"):
    """All that it takes to watch, and nothing that would let anybody publish or change the room."""

    relay: str  # its number here; for POST /whep?relay=
    url: str  # WebSocket
    room: int
    pin: str  # lets in; "" for who takes no part in the session yet
    feed: int  # the publisher to subscribe to; another one with every publication
    streams: list[StreamInfo]  # `mid` is the publisher's


class RelayAnswer(msgspec.Struct, frozen=True):
    """Answer of GET /api/relay."""

    relay: RelayTicket | None  # None: connect to the console for media too


def without_key(ticket: RelayTicket) -> RelayTicket:
    """Where the relay is, and nothing that lets anybody in."""
    return msgspec.structs.replace(ticket, pin="")
