"""The messages of an observer that watches through a relay: one WebSocket for all channels.

It costs nothing while it is idle. It carries the messages that data channels would carry; the kind of a message tells
its channel.
"""

import asyncio
import secrets
from collections.abc import Callable, Coroutine
from typing import Any, Protocol

from lockstep.protocol.console import Quality, Report, StreamInfo, Tier
from lockstep.server.auth.tokens import Identity
from lockstep.server.errors import TransportRefused
from lockstep.server.media.picture_traces import PictureTraces
from lockstep.server.peers.channel_queue import ChannelQueue
from lockstep.server.peers.channels import CHANNELS, ChannelName
from lockstep.server.peers.peer import Peer, PeerHost, PeerLimits
from lockstep.server.peers.transport import TransportEvents
from lockstep.server.util.fair_queue import FairQueue

__all__ = ["TICKET_SECONDS", "Line", "LineEnded", "WebSocketTransport", "close_code", "peer_beside_relay"]

TICKET_SECONDS = 10.0  # from the answer with the ticket to the line
BEATS = 2.0  # factor of the silence allowed to others: a watcher reports every 15 s, and one report may be late
READ_SECONDS = 10.0  # one message may wait this long for a remote that does not read
GOODBYE_SECONDS = 1.0

# RFC 6455 7.4.1 and the IANA registry
NORMAL, GOING_AWAY, NOT_UTF8, POLICY_VIOLATION, TOO_BIG = 1000, 1001, 1007, 1008, 1009
INTERNAL_ERROR, SERVICE_RESTART = 1011, 1012
TRANSPORT_ERRORS = {NOT_UTF8: "not_utf8", POLICY_VIOLATION: "too_many_frames", TOO_BIG: "too_large"}
CLOSE_CODES = {
    "shutdown": GOING_AWAY,
    "new epoch": SERVICE_RESTART,
    "internal error": INTERNAL_ERROR,
    **dict.fromkeys(
        ("link revoked", "link expired", "links unreadable", "bad messages", "too much", "does not read"),
        POLICY_VIOLATION,
    ),
}


class LineEnded(Exception):
    """The line is gone. `code` is the close code of the WebSocket."""

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


class Line(Protocol):
    """One WebSocket; its messages are text."""

    async def receive(self) -> str | bytes:
        """Wait for the next message. Raises LineEnded."""
        ...

    async def send(self, text: str) -> None:
        """Send a message; wait while the remote does not read. Raises LineEnded."""
        ...

    async def close(self, code: int, reason: str) -> None: ...


class WebSocketTransport:
    """A `Transport`. Its peer runs from its admission on, as every peer does.

    The request that brings the ticket in time calls `serve`.

    Attributes:
        ticket: secret, good for one WebSocket: the request that uses it sets it to ""
    """

    def __init__(self, turns: FairQueue, name: str) -> None:
        """`turns` orders the writes to all watchers, so that commands are handled between the copies of a broadcast.

        `name`: one of its own in `turns`
        """
        self.ticket = secrets.token_urlsafe(16)
        self._turns = turns
        self._name = name
        self._queue = ChannelQueue()  # messages that wait to be sent, bounded as for a data channel
        self._filled = asyncio.Event()
        self._peer: TransportEvents | None = None

    def listen(self, events: TransportEvents) -> None:
        self._peer = events

    @property
    def lost(self) -> int:
        return self._queue.dropped

    def send(self, channel: ChannelName, text: str) -> None:
        self._queue.put(text)
        self._filled.set()

    def send_newest(self, text: str) -> None:
        self._queue.put_newest(text)
        self._filled.set()

    def send_spare(self, text: str) -> None:
        if self._queue.empty:
            self.send("control", text)

    async def close(self) -> None:
        """Do nothing: `serve` closes the WebSocket."""

    async def serve(self, line: Line) -> None:
        """Speak on `line` until it or the peer ends."""
        peer = self._peer
        if peer is None:
            raise RuntimeError("call listen() first")
        peer.liveness.connect()
        for channel in CHANNELS:
            peer.channel_opened(channel)
        try:
            async with asyncio.TaskGroup() as tasks:
                ways = (self._hear(line, peer), self._tell(line, peer))
                speaking = [tasks.create_task(_try(each, peer)) for each in ways]
                await peer.liveness.until_ended()
                for task in speaking:
                    task.cancel()
        finally:
            peer.end("failed")
            await _hang_up(line, peer.ended)

    async def _hear(self, line: Line, peer: TransportEvents) -> None:
        try:
            while True:
                peer.received(None, await line.receive())
        except LineEnded as ended:
            if ended.code in TRANSPORT_ERRORS:
                peer.refused("transport", TransportRefused(TRANSPORT_ERRORS[ended.code]))
            peer.end("shutdown" if ended.code == SERVICE_RESTART else "line closed")

    async def _tell(self, line: Line, peer: TransportEvents) -> None:
        try:
            while True:
                text = await self._next()
                await self._turns.take(self._name)
                async with asyncio.timeout(READ_SECONDS):
                    await line.send(text)
        except TimeoutError:
            peer.end("does not read")
        except LineEnded:
            return  # `_hear` ends the peer

    async def _next(self) -> str:
        while (text := self._queue.take()) is None:
            self._filled.clear()
            await self._filled.wait()
        return text


def peer_beside_relay(
    relay: str, identity: Identity, host: PeerHost, limits: PeerLimits, turns: FairQueue
) -> tuple[Peer, WebSocketTransport]:
    """Return an observer whose media come from `relay`, and its transport."""
    transport = WebSocketTransport(turns, secrets.token_hex(4))
    peer = Peer(
        transport,
        _NoMedia(),
        identity,
        host,
        limits,
        connect_seconds=TICKET_SECONDS,
        silence_seconds=BEATS * limits.peer_silence,
    )
    peer.relay = relay
    return peer, transport


async def _try(speaking: Coroutine[Any, Any, None], peer: TransportEvents) -> None:
    with peer.contained("line"):
        await speaking


async def _hang_up(line: Line, why: str) -> None:
    try:
        async with asyncio.timeout(GOODBYE_SECONDS):
            await line.close(close_code(why), why)
    except (TimeoutError, LineEnded):
        return  # the server of the line drops it


def close_code(why: str) -> int:
    """Return the close code for the reason that a peer ended."""
    return CLOSE_CODES.get(why, NORMAL)


class _NoMedia:
    """No media from the console: they come from the relay."""

    voice = ""
    tier: Tier | None = None
    loss: float | None = None
    queues = False
    round_trip_ms: float | None = None
    traces = PictureTraces()

    @property
    def streams(self) -> list[StreamInfo]:
        return []

    def report(self, report: Report, now: float) -> None:
        pass

    def drives(self, holds_seat: bool) -> None:
        pass

    def on_quality(self, tell: Callable[[Quality], None]) -> None:
        pass

    def on_failed(self, tell: Callable[[str, Exception], None]) -> None:
        pass

    async def close(self) -> None:
        pass
