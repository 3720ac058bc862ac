"""A connection to a bridge that sends only the messages of a case, besides heartbeats."""

import asyncio
from collections import deque
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import TypeVar, cast

from lockstep.protocol.errors import FramingError, LinkLost, LinkRefused, MessageError
from lockstep.protocol.framing import MAX_CONTROL_FRAME, MAX_MEDIA_FRAME, FrameReader, frame
from lockstep.protocol.link_secret import NONCE_BYTES, LinkSecret, draw_nonce
from lockstep.protocol.messages import (
    Challenge,
    Goodbye,
    Hello,
    LinkMessage,
    LinkRole,
    decode_message,
    encode_message,
)
from lockstep.robot_bridge.conformance.errors import Violation
from lockstep.robot_bridge.conformance.heartbeat import Heartbeat
from lockstep.robot_bridge.conformance.place import Place
from lockstep.robot_bridge.conformance.waiting import PATIENCE, within

__all__ = ["Peer", "opened"]

Kind = TypeVar("Kind", bound=LinkMessage)

MAX_WAITING = 64  # messages that wait for the case; of more, the oldest is forgotten


class Peer(asyncio.Protocol):
    """A connection: `send` and `write` send, `next` and `find` receive.

    Attributes:
        heartbeat: begins with the handshake
        ended: the connection is over
    """

    def __init__(self) -> None:
        self.heartbeat = Heartbeat(self.send)
        self.ended = False
        self._frames = FrameReader(MAX_MEDIA_FRAME)
        self._waiting: deque[LinkMessage] = deque(maxlen=MAX_WAITING)
        self._broken: Violation | None = None  # the bridge sent something that cannot be read
        self._news = asyncio.Event()
        self._transport: asyncio.Transport | None = None

    # Called by cases

    def send(self, *messages: LinkMessage) -> None:
        self.write(b"".join(frame(encode_message(message)) for message in messages))

    def write(self, data: bytes) -> None:
        """Send bytes as they are."""
        if self._transport is not None and not self.ended:
            self._transport.write(data)

    async def next(self, patience: float = PATIENCE) -> LinkMessage | None:
        """Return the next message besides heartbeats; None at the end of the stream.

        Raises:
            Violation: nothing came in time, or something that is not a message.
        """
        async with within(patience, f"no message came for {patience:g} s"):
            while not self._waiting and not self.ended and self._broken is None:
                self._news.clear()
                await self._news.wait()
        if self._waiting:
            return self._waiting.popleft()
        if self._broken is not None:
            raise self._broken
        return None

    async def find(
        self, kind: type[Kind], accept: Callable[[Kind], bool] = lambda message: True, patience: float = PATIENCE
    ) -> Kind:
        """Return the next message of this kind that is accepted; others are passed over.

        Raises:
            Violation: it did not come in time, or the link ended.
        """
        wanted = kind.__name__.lower()
        async with within(patience, f"no such {wanted} within {patience:g} s"):
            while (message := await self.next(patience + 1)) is not None:
                if isinstance(message, kind) and accept(message):
                    return message
                if isinstance(message, Goodbye):
                    raise Violation(f"the link ended: {message.error}; a {wanted} was expected")
        raise Violation(f"the connection ended; a {wanted} was expected")

    async def ends(self, *errors: str, patience: float = PATIENCE) -> None:
        """Wait until the bridge ends the link, with a goodbye that names one of these errors.

        Raises:
            Violation: it does not, or for another reason.
        """
        async with within(patience, f"the link is still open after {patience:g} s"):
            while not isinstance(goodbye := await self.next(patience + 1), Goodbye):
                if goodbye is None:
                    raise Violation("the connection ended without a goodbye")
                if isinstance(goodbye, Hello):
                    raise Violation("the bridge admitted the link")
        if goodbye.error not in errors:
            raise Violation(f"the link ended with {goodbye.error!r}, not {' or '.join(map(repr, errors))}")
        if await self.next() is not None:
            raise Violation("a message came after the goodbye")

    async def hello(self, role: LinkRole, secret: LinkSecret | None = None, name: str = "") -> Hello:
        """Shake hands, and return the bridge's hello.

        Raises:
            LinkRefused: the bridge said goodbye; the detail begins with its error.
            Violation: the protocol does not know such an answer.
        """
        said = Hello(role=role, name=name, nonce=b"" if secret is None else draw_nonce())
        self.send(said)
        answer = await self.next()
        nonce = b""
        if isinstance(answer, Challenge) and secret is not None:
            nonce = answer.nonce
            if len(nonce) != NONCE_BYTES:
                raise Violation(f"a challenge of {len(nonce)} bytes, not {NONCE_BYTES}")
            proof = secret.client_proof(said.nonce, nonce, role)
            self.send(Hello(role=role, name=name, nonce=said.nonce, proof=proof))
            answer = await self.next()
        if isinstance(answer, Hello):
            self.heartbeat.begin()
        if isinstance(answer, Goodbye):
            raise LinkRefused(f"{answer.error}: {answer.detail}")
        if not isinstance(answer, Hello):
            raise Violation(f"a hello was answered with {type(answer).__name__.lower()}")
        if secret is not None and (
            not nonce or not LinkSecret.same(answer.proof, secret.bridge_proof(said.nonce, nonce, answer.epoch))
        ):
            raise Violation("the bridge does not prove that it knows the link secret")
        self._frames.max_frame = MAX_MEDIA_FRAME if role == "media" else MAX_CONTROL_FRAME
        return answer

    def drain(self) -> list[LinkMessage]:
        """Return the messages that wait, without waiting for more."""
        waiting = list(self._waiting)
        self._waiting.clear()
        return waiting

    async def pinged(self, times: int, patience: float) -> int:
        """Wait for a number of pings, for at most `patience` seconds; return the number that came."""
        try:
            async with asyncio.timeout(patience):
                while self.heartbeat.pings < times and not self.ended:
                    self._news.clear()
                    await self._news.wait()
        except TimeoutError:
            pass
        return self.heartbeat.pings

    def leave(self) -> None:
        """Say goodbye and close."""
        self.send(Goodbye(error="closing"))
        self.cut()

    def cut(self) -> None:
        """Close without a goodbye, like a link that breaks."""
        self.heartbeat.stop()
        if self._transport is not None:
            self._transport.close()

    async def gone(self) -> None:
        """Wait until the connection is closed."""
        async with asyncio.timeout(PATIENCE):
            while not self.ended:
                self._news.clear()
                await self._news.wait()

    # asyncio.Protocol

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.Transport, transport)  # TCP

    def data_received(self, data: bytes) -> None:
        self._frames.feed(data)
        try:
            for payload in self._frames.frames():
                message = decode_message(payload)
                if not self.heartbeat.take(message):
                    self._waiting.append(message)
        except (FramingError, MessageError) as error:
            self._broken = self._broken or Violation(f"the bridge sent bytes that are not a message: {error.detail}")
        self._news.set()

    def connection_lost(self, error: Exception | None) -> None:
        self.ended = True
        self.heartbeat.stop()
        self._news.set()


@asynccontextmanager
async def opened(place: Place) -> AsyncIterator[Peer]:
    """Open a connection on which no message was sent yet; leave it with a goodbye, unless it is over.

    Raises:
        LinkLost: no process listens there.
    """
    loop = asyncio.get_running_loop()
    try:
        async with asyncio.timeout(PATIENCE):
            _, peer = await loop.create_connection(Peer, place.host, place.port, ssl=place.tls)
    except (OSError, TimeoutError) as error:
        raise LinkLost(f"{place.host}:{place.port}: {error or 'no answer'}") from error
    try:
        yield peer
    finally:
        peer.leave()
        await peer.gone()
