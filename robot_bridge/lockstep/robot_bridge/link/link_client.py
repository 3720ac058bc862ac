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
from lockstep.protocol.messages import Goodbye, Hello, LinkMessage, LinkRole
from lockstep.robot_bridge.link.ask_timer import AskTimer
from lockstep.robot_bridge.link.link_inbox import LinkInbox
from lockstep.robot_bridge.link.link_session import BadInput, ClientSession
from lockstep.robot_bridge.link.link_transport import TICK_INTERVAL
from lockstep.robot_bridge.link.pacing.paced_transport import PacedTransport

__all__ = ["RobotLink"]

CONNECT_TIMEOUT = 5.0  # s


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
        self._host = host
        self._port = port
        self._tls = tls
        self._session = ClientSession(time.monotonic(), role, name, secret)
        self._inbox = LinkInbox()
        self._transport = _ClientTransport(self._session, self._inbox)
        self.bad_input: Counter[str] = self._transport.bad_input  # by name, {"malformed": 1}
        self.drops: Counter[str] = self._inbox.drops  # by message kind, {"feedback": 2}; media are in `media_drops`
        self._ticker: asyncio.TimerHandle | None = None
        self._asker = AskTimer(self._session, self._transport.tick)
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
        return self._inbox.media_drops

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
                    await self._inbox.changed()
        except (OSError, TimeoutError) as error:
            await self.close()
            raise LinkLost(f"{self._host}:{self._port}: {error or 'no answer'}") from error
        except BaseException:
            await self.close()
            raise
        if self._session.hello is None:
            await self.close()
            raise error_of(self._session)

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
            raise error_of(self._session)
        self._transport.send(message)
        self._asker.sent(message)

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
        try:
            self._inbox.hand_over(take)
            while not self._closed and self._session.ended is None and self._inbox.failure is None:
                await self._inbox.changed()
        finally:
            self._inbox.keep()
        if self._inbox.failure is not None:
            raise self._inbox.failure
        if not self._closed:
            raise error_of(self._session)

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> LinkMessage:
        while True:
            message = self._inbox.pop()
            if message is not None:
                return message
            if self._closed:
                raise StopAsyncIteration
            if self._session.ended is not None:
                raise error_of(self._session)
            await self._inbox.changed()

    async def close(self) -> None:
        """Say goodbye and close, in a second at most. May be called again."""
        self._closed = True
        self._asker.cancel()
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
            self._inbox.wake()

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


class _ClientTransport(PacedTransport):
    def __init__(self, session: ClientSession, inbox: LinkInbox) -> None:
        super().__init__(session)
        self.bad_input: Counter[str] = Counter()
        self._inbox = inbox
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
        if isinstance(event, BadInput):
            self.bad_input[event.name] += 1
            self._inbox.wake()
        elif isinstance(event, Hello):
            self._inbox.wake()
        else:
            self._inbox.put(event)

    def lost(self) -> None:
        self._inbox.wake()


def error_of(session: ClientSession) -> LinkError:
    """Return the error that says why a link is over, or was never there."""
    ended = session.ended or Goodbye(error="lost", detail="not connected")
    text = f"{ended.error}: {ended.detail}"
    if session.hello is not None or ended.error == "lost":
        return LinkLost(text)
    if ended.error in ("handshake", "version", "description", "framing", "silent"):
        return HandshakeError(text)
    return LinkRefused(text)
