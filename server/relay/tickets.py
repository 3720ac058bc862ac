"""What an observer is told who watches through a relay: where, and what is there."""

import msgspec

from robot_bridge.protocol.console import StreamInfo

__all__ = ["JanusTicket", "RelayAnswer", "RelayTicket", "without_key"]


class RelayTicket(msgspec.Struct, frozen=True, kw_only=True, tag_field="engine"):
    """All that it takes to watch, and nothing that would let anybody publish or change the room."""

    relay: str  # its number here; for POST /whep?relay=
    url: str  # WebSocket
    feed: int  # what to watch; another one with every publication
    streams: list[StreamInfo]  # `mid` is the publisher's


class JanusTicket(RelayTicket, frozen=True, kw_only=True, tag="janus"):
    """`feed` is the publisher to subscribe to."""

    room: int
    pin: str  # lets in; "" for who takes no part in the session yet


class RelayAnswer(msgspec.Struct, frozen=True):
    """Answer of GET /api/relay."""

    relay: JanusTicket | None  # None: connect to the console for media too


def without_key(ticket: JanusTicket) -> JanusTicket:
    """Where the relay is, and nothing that lets anybody in."""
    return msgspec.structs.replace(ticket, pin="")
