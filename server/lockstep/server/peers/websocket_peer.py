"""An observer that watches through a relay: it talks to the console over its line, one WebSocket for all channels.

An idle line costs nothing. It carries the messages that data channels would carry; the kind of a message tells its
channel.
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
from lockstep.server.peers.channels import CHANNELS
from lockstep.server.peers.peer import Peer, PeerHost, PeerLimits
from lockstep.server.util.fair_queue import FairQueue

__all__ = ["TICKET_SECONDS", "Line", "LineEnded", "WebSocketPeer", "close_code"]

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


class WebSocketPeer(Peer):
    """Runs from its admission on, as every peer does; the request that brings its ticket in time calls `serve`.

    Attributes:
        ticket: secret, good for one line: the request that uses it sets it to ""
    """

    def __init__(self, relay: str, identity: Identity, host: PeerHost, limits: PeerLimits, turns: FairQueue) -> None:
        """`turns` orders the writes to all watchers, so that commands are handled between the copies of a broadcast."""
        super().__init__(
            _NoMedia(),
            identity,
            host,
            limits,
            connect_seconds=TICKET_SECONDS,
            silence_seconds=BEATS * limits.peer_silence,
        )
        self.relay = relay
        self.ticket = secrets.token_urlsafe(16)
        self._turns = turns
        self._writer = _LineWriter()

    async def serve(self, line: Line) -> None:
        """Speak on `line` until it or this peer ends."""
        self._connection_made()
        for channel in CHANNELS:
            self._open(channel, self._writer)
        try:
            async with asyncio.TaskGroup() as tasks:
                speaking = [tasks.create_task(self._try(each)) for each in (self._hear(line), self._tell(line))]
                await self._end.wait()
                for task in speaking:
                    task.cancel()
        finally:
            self.end("failed")
            await self._hang_up(line)

    async def _try(self, speaking: Coroutine[Any, Any, None]) -> None:
        with self.contained("line"):
            await speaking

    async def _hear(self, line: Line) -> None:
        try:
            while True:
                self._received(None, await line.receive())
        except LineEnded as ended:
            if ended.code in TRANSPORT_ERRORS:
                self._host.input_refused(self, "transport", TransportRefused(TRANSPORT_ERRORS[ended.code]))
                self.end("too much")
            self.end("shutdown" if ended.code == SERVICE_RESTART else "line closed")

    async def _tell(self, line: Line) -> None:
        try:
            while True:
                text = await self._writer.next()
                await self._turns.take(self.id)
                async with asyncio.timeout(READ_SECONDS):
                    await line.send(text)
        except TimeoutError:
            self.end("does not read")
        except LineEnded:
            return  # `_hear` ends the peer

    async def _hang_up(self, line: Line) -> None:
        try:
            async with asyncio.timeout(GOODBYE_SECONDS):
                await line.close(close_code(self.ended), self.ended)
        except (TimeoutError, LineEnded):
            return  # the server of the line drops it

    async def _close_transport(self) -> None:
        """Do nothing: `serve` closes the line."""


def close_code(why: str) -> int:
    """Return the close code for the reason that a peer ended."""
    return CLOSE_CODES.get(why, NORMAL)


class _LineWriter:
    """Messages that wait to be sent, bounded as for a data channel."""

    def __init__(self) -> None:
        self._outbox = ChannelQueue()
        self._filled = asyncio.Event()

    @property
    def lost(self) -> int:
        return self._outbox.dropped

    def send(self, text: str) -> None:
        self._outbox.put(text)
        self._filled.set()

    def send_newest(self, text: str) -> None:
        self._outbox.put_newest(text)
        self._filled.set()

    def send_spare(self, text: str) -> None:
        if self._outbox.empty:
            self.send(text)

    async def next(self) -> str:
        while (text := self._outbox.take()) is None:
            self._filled.clear()
            await self._filled.wait()
        return text


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
