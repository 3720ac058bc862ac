"""The interface of a connection for one peer's messages, by WebRTC or by WebSocket.

The Python client's is `lockstep.client.transport.transport`, the page's `web/src/transport/transport.ts`.
"""

from contextlib import AbstractContextManager
from typing import Protocol

from lockstep.server.errors import ChannelError
from lockstep.server.peers.channels import ChannelName
from lockstep.server.peers.liveness import Liveness

__all__ = ["Transport", "TransportEvents"]


class TransportEvents(Protocol):
    """Takes what happens on a transport. All methods are called on the loop and return at once."""

    @property
    def ended(self) -> str:
        """The reason that the peer has ended, after which its transport hands on nothing; "" while it lives."""

    @property
    def liveness(self) -> Liveness:
        """The transport tells it of the connection, and may wait for the end."""

    def channel_opened(self, channel: ChannelName) -> None: ...

    def received(self, channel: ChannelName | None, data: object) -> None:
        """Take a message. `channel`: None on a WebSocket, which carries all."""

    def refused(self, channel: str, error: ChannelError) -> None:
        """Count input that is no message of a known channel; too much of it ends the peer.

        TransportRefused ends it at once: more came, below its messages, than the transport can hold.
        """

    def end(self, why: str) -> None:
        """End the peer. Only the first reason counts."""

    def failed(self, stage: str, error: Exception) -> None:
        """End the peer, since serving it raised `error`."""

    def contained(self, stage: str) -> AbstractContextManager[None]:
        """Let exceptions of the block end this peer, and nothing else."""


class Transport(Protocol):
    """Order: `listen`, then the methods that send, on channels that `channel_opened` has named; `close`.

    No method waits for the remote but `close`.
    """

    @property
    def lost(self) -> int:
        """Messages that did not fit."""

    def listen(self, events: TransportEvents) -> None: ...

    def send(self, channel: ChannelName, text: str) -> None:
        """Send, or keep the message until it can be sent. Beyond a bound the oldest is lost."""

    def send_newest(self, text: str) -> None:
        """Send on `control`. While it waits, a newer one takes its place."""

    def send_spare(self, text: str) -> None:
        """Send on `control` unless something waits there already: then nobody needs it."""

    async def close(self) -> None:
        """End the connection. Idempotent."""
