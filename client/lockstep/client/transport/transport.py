"""The interface of a connection for messages, by WebRTC or by WebSocket."""

import asyncio
from typing import Literal, Protocol

from lockstep.client.transport.packets import Packets
from lockstep.client.transport.sdp import Section
from lockstep.client.transport.whep import Whep
from lockstep.protocol.console import ClientMessage

__all__ = ["ChannelName", "Transport"]

ChannelName = Literal["control", "session", "stop"]


class Transport(Protocol):
    """A connection to a console. Order: `negotiate`, `connect`; then `run`, and `send` until `ended` is set; `close`.

    Attributes:
        ended: set when the connection has ended
        why: the reason for that
        whep: the requests to the console by HTTP
        packets: the source of media packets, after `negotiate`; None: it carries no media
        reliable: True if no message is lost on the way
    """

    ended: asyncio.Event
    why: str
    whep: Whep
    packets: Packets | None
    reliable: bool

    async def negotiate(self) -> list[Section]:
        """Agree with the console on a connection; return its media sections.

        Raises:
            SignallingRefused, ConnectFailed: as `Whep.offer`.
        """

    async def connect(self, seconds: float) -> None:
        """Return when messages can be sent. Raises ConnectFailed."""

    async def run(self) -> None:
        """Receive and send until the connection has ended."""

    def send(self, channel: ChannelName, message: ClientMessage) -> None:
        """Send a message; ignored after the end."""

    def lose(self, why: str) -> None:
        """Count the connection as lost; the first reason stands."""

    async def restart_ice(self, seconds: float) -> None:
        """Look for another path. Raises SignallingRefused or ConnectFailed."""

    async def close(self) -> None:
        """End the connection. Idempotent."""
