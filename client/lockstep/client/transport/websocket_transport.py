"""An observer's WebSocket to the console beside a relay, for all messages that data channels would carry."""

import asyncio
import ssl
from collections import deque
from collections.abc import Callable
from pathlib import Path

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, WebSocketException

from lockstep.client.console_url import ConsoleLink
from lockstep.client.errors import ConnectFailed, ConsoleError, SignallingRefused
from lockstep.client.transport.message_turns import MAX_UNREAD, in_turns
from lockstep.client.transport.paced_connection import PacedConnection
from lockstep.client.transport.packets import Packets
from lockstep.client.transport.sdp import Section
from lockstep.client.transport.transport import ChannelName
from lockstep.client.transport.whep import Whep
from lockstep.protocol.console import ClientMessage, Report, encode_console_message
from lockstep.protocol.messages import Ping

__all__ = ["WebSocketBlocked", "WebSocketTransport"]

OPEN_SECONDS = 5.0
UNREAD_SECONDS = 0.5  # s more for an answer: a client that was held up may have it waiting, not yet read
CLOSE_SECONDS = 3.0
MAX_MESSAGE = 1024 * 1024  # bytes; the list of a thousand participants is the largest
MAX_WAITING = 64  # messages that could not leave yet; beyond that the oldest are dropped


class WebSocketBlocked(ConnectFailed):
    """No WebSocket to the console opens, though it answers over HTTP: a proxy or firewall lets none pass."""


class WebSocketTransport:
    """A `Transport` by WebSocket, for an observer, whose media come from a relay."""

    def __init__(
        self,
        link: ConsoleLink,
        relay: str,
        tls_ca: Path | None,
        on_message: Callable[[str | bytes], None],
        silence_seconds: float,
    ) -> None:
        """`silence_seconds`: time within which the console says something after a ping."""
        self.whep = Whep(link, tls_ca)
        self.packets: Packets | None = None
        self.reliable = True
        self.ended = asyncio.Event()
        self.why = ""  # reason that it ended
        self.skipped = 0  # messages that did not fit
        self._link = link
        self._relay = relay
        self._tls_ca = tls_ca
        self._on_message = on_message
        self._silence_seconds = silence_seconds
        self._socket: ClientConnection | None = None
        self._waiting: deque[str] = deque()
        self._filled = asyncio.Event()
        self._answer_due: asyncio.TimerHandle | None = None
        self._closing = False

    async def negotiate(self) -> list[Section]:
        """Open the WebSocket. There are no media sections.

        Raises:
            SignallingRefused, ConnectFailed: as `Whep.offer`.
            WebSocketBlocked: the console takes a WebSocket, but none can be opened; or the console does not know them.
        """
        try:
            ticket = await self.whep.watch(self._relay)
        except SignallingRefused as error:
            if error.status in (404, 405):
                raise WebSocketBlocked("this console offers no WebSocket for observers") from error
            raise
        try:
            self._socket = await connect(
                f"{self._link.base.replace('http', 'ws', 1)}/watch/{ticket}",
                ssl=self._trust(),
                open_timeout=OPEN_SECONDS,
                close_timeout=1.0,
                max_size=MAX_MESSAGE,
                max_queue=MAX_UNREAD,
                ping_interval=None,  # the reports serve as pings, and the console pings too
                compression=None,
                proxy=None if self._link.loopback else True,
                create_connection=PacedConnection,
            )
        except (OSError, TimeoutError, ImportError, WebSocketException) as error:
            # ImportError: this kind of proxy needs a package that is not installed.
            await self._give_back(ticket)
            raise WebSocketBlocked(f"no WebSocket to the console opens ({error or type(error).__name__})") from error
        return []

    async def connect(self, seconds: float) -> None:
        """Return at once: the WebSocket is open."""

    async def run(self) -> None:
        """Read and write until the WebSocket has closed."""
        async with asyncio.TaskGroup() as tasks:
            writing = tasks.create_task(self._tell())
            await self._hear()
            writing.cancel()

    def send(self, channel: ChannelName, message: ClientMessage) -> None:
        """Send a message; its kind says which channel it is for."""
        if self.ended.is_set():
            return
        if len(self._waiting) >= MAX_WAITING:
            self._waiting.popleft()
            self.skipped += 1
        self._waiting.append(encode_console_message(message))
        self._filled.set()
        if self._answer_due is None and isinstance(message, Ping | Report):
            self._answer_due = asyncio.get_running_loop().call_later(self._silence_seconds, self._overdue)

    def lose(self, why: str) -> None:
        """Count the connection as lost; the first reason stands."""
        if not self._closing and not self.ended.is_set():
            self.why = why
            self.ended.set()

    async def restart_ice(self, seconds: float) -> None:
        """Raise ConnectFailed: there is no ICE in TCP."""
        raise ConnectFailed("this observer's WebSocket to the console is TCP: for another path make a new Console")

    async def close(self) -> None:
        """Close the WebSocket. Idempotent."""
        if self._closing:
            return
        self._closing = True
        self.ended.set()
        self._heard()
        try:
            if self._socket is not None:
                async with asyncio.timeout(CLOSE_SECONDS):
                    await self._socket.close()
        except TimeoutError:
            pass  # the console notices without a message
        finally:
            if self._socket is not None:
                self._socket.transport.abort()  # websockets leaves it open when its close is cancelled
            await self.whep.aclose()

    async def _hear(self) -> None:
        if self._socket is None:
            return
        try:
            async for data in in_turns(self._socket.recv):
                self._heard()
                self._on_message(data)
        except ConnectionClosed:
            reason = self._socket.close_reason
            self.lose(f"the console closed the connection ({reason})" if reason else "the connection was lost")

    async def _tell(self) -> None:
        if self._socket is None:
            return
        try:
            while True:
                while self._waiting:
                    await self._socket.send(self._waiting.popleft())
                self._filled.clear()
                await self._filled.wait()
        except ConnectionClosed:
            return  # `_hear` notices this too

    def _heard(self) -> None:
        if self._answer_due is not None:
            self._answer_due.cancel()
            self._answer_due = None

    def _overdue(self) -> None:
        self._answer_due = asyncio.get_running_loop().call_later(UNREAD_SECONDS, self._no_answer)

    def _no_answer(self) -> None:
        self._answer_due = None
        self.lose(f"the console did not answer for {self._silence_seconds:g} s")

    def _trust(self) -> ssl.SSLContext | None:
        return ssl.create_default_context(cafile=self._tls_ca) if self._link.secure else None

    async def _give_back(self, ticket: str) -> None:
        try:
            async with asyncio.timeout(CLOSE_SECONDS):
                await self.whep.decline(ticket)
        except (TimeoutError, ConsoleError):
            pass  # the ticket expires without being cancelled
