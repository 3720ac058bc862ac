"""The robot link's client, for the console's server and for other programs."""

import asyncio
import ssl
import time
from collections import Counter
from collections.abc import Callable
from types import TracebackType
from typing import Self

from lockstep.protocol.errors import HandshakeError, LinkError, LinkLost, LinkRefused
from lockstep.protocol.link_secret import LinkSecret
from lockstep.protocol.messages import Goodbye, Hello, LinkMessage, LinkRole, Media
from lockstep.robot_bridge.link.link_session import BadInput, ClientSession, kind_of
from lockstep.robot_bridge.link.link_transport import TICK_INTERVAL
from lockstep.robot_bridge.link.pacing.paced_transport import PacedTransport
from lockstep.robot_bridge.link.sending.outgoing_queues import MediaOutbox

__all__ = ["RobotLink"]

CONNECT_TIMEOUT = 5.0  # s
MAX_INBOX = 256  # messages besides media that may wait for the reader


class RobotLink:
    """A connection to a bridge.

    >>> async with RobotLink("127.0.0.1", 5600, "operator", name="my console") as link:
    ...     async for message in link:
    ...         link.send(...)

    It does not reconnect: make a new one. Iterating raises `LinkError` when the link breaks and ends after `close`. A
    reader that falls behind loses the oldest messages and, per stream, all but the newest pictures; both are counted in
    `drops`.
    """

    def __init__(
        self,
        host: str,
        port: int,
        role: LinkRole,
        *,
        name: str = "",
        secret: LinkSecret | None = None,
        tls: ssl.SSLContext | None = None,
        connect: Callable[[asyncio.Protocol], None] | None = None,
    ) -> None:
        """`secret`: both sides prove that they know it. `tls`: made by `LinkTls.client_context`.

        `connect`: gives the link a connection that the bridge has opened, from `host`; None: the link opens one.
        """
        self._connect = connect
        self.role: LinkRole = role
        self.bad_input: Counter[str] = Counter()  # by name, {"malformed": 1}
        self.drops: Counter[str] = Counter()  # by message kind, {"feedback": 2}; media are in `media_drops`
        self._host = host
        self._port = port
        self._tls = tls
        self._session = ClientSession(time.monotonic(), role, name, secret)
        self._transport = _ClientTransport(self, self._session)
        self._inbox: dict[int, LinkMessage] = {}  # by arrival, oldest first
        self._arrivals = 0
        self._media: MediaOutbox[Media] = MediaOutbox()
        self._news = asyncio.Event()
        self._ticker: asyncio.TimerHandle | None = None
        self._take: Callable[[LinkMessage], None] | None = None  # None: messages wait for the iteration
        self._failure: Exception | None = None  # the exception that `take` raised
        self._closed = False

    @property
    def hello(self) -> Hello:
        """The bridge's hello: its epoch and, unless the role is `events`, the description.

        Raises:
            LinkError: not connected yet.
        """
        if self._session.hello is None:
            raise LinkLost("not connected")
        return self._session.hello

    @property
    def media_drops(self) -> Counter[str]:
        """The dropped media by stream."""
        return self._media.drops

    @property
    def connected(self) -> bool:
        """True if the handshake is done and the link lives."""
        return self._session.hello is not None and self._session.ended is None

    async def connect(self) -> None:
        """Connect and shake hands. Call once.

        Raises:
            LinkLost: no process listens there, or it does not answer.
            LinkRefused: the bridge said goodbye; the detail begins with its stable name, as in "taken: ...".
            HandshakeError: the process there is not a bridge of this protocol version.
        """
        try:
            async with asyncio.timeout(CONNECT_TIMEOUT):
                await self._open()
                self._tick()
                while self._session.hello is None and self._session.ended is None:
                    self._news.clear()
                    await self._news.wait()
        except (OSError, TimeoutError) as error:
            await self.close()
            raise LinkLost(f"{self._host}:{self._port}: {error or 'no answer'}") from error
        except BaseException:
            await self.close()
            raise
        if self._session.hello is None:
            await self.close()
            raise self._error()

    async def _open(self) -> None:
        if self._connect is not None:
            self._connect(self._transport)
            return
        loop = asyncio.get_running_loop()
        try:
            await loop.create_connection(lambda: self._transport, self._host, self._port, ssl=self._tls)
        except BaseException as error:
            # uvloop closes the transport, does not tell its protocol, and raises where that writes a goodbye.
            self._transport.connection_lost(error if isinstance(error, Exception) else None)
            raise

    def send(self, message: LinkMessage) -> None:
        """Send without waiting; while the socket is full only the newest of each kind is kept.

        Raises:
            LinkError: the link is over.
        """
        if not self.connected:
            raise self._error()
        self._transport.send(message)

    def fileno(self) -> int:
        """Return the socket's descriptor, to see whether data has come (select(2)); -1 without a socket."""
        return self._transport.output.fileno()

    async def deliver(self, take: Callable[[LinkMessage], None]) -> None:
        """Hand each message to `take` as it comes, within its turn of the event loop, until `close`.

        Iteration gets messages a turn or two later. Here no message waits for a reader, and none is dropped.

        Raises:
            LinkError: the link broke.
            Exception: the one that `take` raised; nothing was handed over after that.
        """
        self._take = take
        try:
            while self._take is not None and (waits := self._oldest()) is not None:
                self._hand_over(take, waits)
            while not self._closed and self._session.ended is None and self._failure is None:
                self._news.clear()
                await self._news.wait()
        finally:
            self._take = None
        if self._failure is not None:
            raise self._failure
        if not self._closed:
            raise self._error()

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> LinkMessage:
        while True:
            message = self._oldest()
            if message is not None:
                return message
            if self._closed:
                raise StopAsyncIteration
            if self._session.ended is not None:
                raise self._error()
            self._news.clear()
            await self._news.wait()

    async def close(self) -> None:
        """Say goodbye and close, in a second at most. May be called again."""
        self._closed = True
        if self._ticker is not None:
            self._ticker.cancel()
            self._ticker = None
        self._transport.say_goodbye()
        try:
            async with asyncio.timeout(1.0):
                await self._transport.gone.wait()
        except TimeoutError:
            pass
        finally:  # also when this is cancelled: a bridge that goes on sending would be read for ever
            self._transport.abort()
            self._news.set()

    async def __aenter__(self) -> Self:
        await self.connect()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    def _tick(self) -> None:
        self._transport.tick()
        if self._session.ended is None:
            self._ticker = asyncio.get_running_loop().call_later(TICK_INTERVAL, self._tick)

    def _oldest(self) -> LinkMessage | None:
        """Remove and return the oldest waiting message, media last."""
        return self._inbox.pop(next(iter(self._inbox))) if self._inbox else self._media.pop()

    def _hand_over(self, take: Callable[[LinkMessage], None], message: LinkMessage) -> None:
        try:
            take(message)
        except Exception as error:
            self._failure = error
            self._take = None
            self._news.set()

    def _received(self, event: LinkMessage | BadInput) -> None:
        if isinstance(event, BadInput):
            self.bad_input[event.name] += 1
        elif self._take is not None and not isinstance(event, Hello):
            self._hand_over(self._take, event)
            return
        elif isinstance(event, Media):
            self._media.put(event, lambda: event)
        elif not isinstance(event, Hello):
            self._arrivals += 1
            self._inbox[self._arrivals] = event
            if len(self._inbox) > MAX_INBOX:
                dropped = self._inbox.pop(next(iter(self._inbox)))
                self.drops[kind_of(dropped)] += 1
        self._news.set()

    def _ended(self) -> None:
        self._news.set()

    def _error(self) -> LinkError:
        ended = self._session.ended or Goodbye(error="lost", detail="not connected")
        text = f"{ended.error}: {ended.detail}"
        if self._session.hello is not None or ended.error == "lost":
            return LinkLost(text)
        if ended.error in ("handshake", "version", "description", "framing", "silent"):
            return HandshakeError(text)
        return LinkRefused(text)


class _ClientTransport(PacedTransport):
    def __init__(self, link: RobotLink, session: ClientSession) -> None:
        super().__init__(session)
        self._link = link
        self.gone = asyncio.Event()
        self.gone.set()

    def say_goodbye(self) -> None:
        """Say goodbye, and close when the bridge has closed.

        To close with received data unread resets the connection, and the bridge would lose the goodbye that it has not
        read yet: it would keep the robot for this client, as after a broken link.
        """
        self.output.waits_for_end = self._transport is not None and self._transport.can_write_eof()
        self.end("closing")

    def data_received(self, data: bytes) -> None:
        if self.session.ended is None:
            super().data_received(data)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.gone.clear()
        super().connection_made(transport)

    def connection_lost(self, error: Exception | None) -> None:
        super().connection_lost(error)
        self.gone.set()

    def received(self, event: LinkMessage | BadInput) -> None:
        self._link._received(event)

    def lost(self) -> None:
        self._link._ended()
