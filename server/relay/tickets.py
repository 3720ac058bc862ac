"""What an observer is told who watches through a relay: where, and what is there."""

from typing import Literal

import msgspec

from robot_bridge.protocol.console import StreamInfo

__all__ = ["RelayAnswer", "RelayTicket"]


class RelayTicket(msgspec.Struct, frozen=True, kw_only=True):
    """All that it takes to watch, and nothing that would let anybody publish or change the room."""

    engine: Literal["janus"]
    relay: str  # its number here; for POST /whep?relay=
    url: str  # WebSocket
    room: int
    pin: str
    feed: int  # who to subscribe to; another one with every publication
    streams: list[StreamInfo]  # `mid` is the publisher's


class RelayAnswer(msgspec.Struct, frozen=True):
    """Answer of GET /api/relay."""

    relay: RelayTicket | None  # None: connect to the console for media too
