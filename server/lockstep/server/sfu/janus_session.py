"""One session with a Janus over its WebSocket (https://janus.conf.meetecho.com/docs/rest.html)."""

import asyncio
import itertools
import secrets
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from typing import Any

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import InvalidHandshake, WebSocketException
from websockets.typing import Subprotocol

from lockstep.protocol.errors import MessageError
from lockstep.protocol.janus import JANUS_PROTOCOL, VIDEO_ROOM, Heard, janus_request, parse_janus
from lockstep.server.sfu.errors import RelayRefused, RelaySilent, RelayUnreachable
from lockstep.server.util.background_tasks import background_tasks

__all__ = ["JanusSession", "open_janus"]

ANSWER_SECONDS = 5.0
KEEPALIVE_SECONDS = 2.0  # Janus itself forgets a session after 60 s; a relay that hangs is noticed by this
MAX_MESSAGE = 256 * 1024  # bytes


@asynccontextmanager
async def open_janus(url: str) -> AsyncIterator["JanusSession"]:
    """Hold a session while entered. If the connection is lost, `ended` is set and every request fails.

    Raises:
        RelayUnreachable, RelayRefused, RelaySilent: on entering.
    """
    try:
        socket = await connect(
            url,
            subprotocols=[Subprotocol(JANUS_PROTOCOL)],
            open_timeout=ANSWER_SECONDS,
            close_timeout=1.0,
            max_size=MAX_MESSAGE,
            ping_interval=None,  # the keepalive does that
            proxy=None,
        )
    except (OSError, TimeoutError, InvalidHandshake) as error:
        raise RelayUnreachable(str(error) or type(error).__name__) from error
    try:
        async with socket:
            session = JanusSession(socket)
            async with background_tasks(session.listen(), session.keep_alive()):
                await session.begin()
                yield session
    finally:
        socket.transport.abort()  # websockets leaves it open when its close is cancelled


class JanusSession:
    """Requests and their answers. Events that answer nothing go to the handle's listener."""

    def __init__(self, socket: ClientConnection) -> None:
        self.ended = asyncio.Event()
        self.why = ""  # reason of the end
        self.malformed = 0  # messages that could not be read
        self._socket = socket
        self._session: int | None = None
        self._numbers = itertools.count(1)
        self._prefix = secrets.token_hex(4)
        self._waiting: dict[str, tuple[asyncio.Future[Heard], bool]] = {}  # True: an ack is answer enough
        self._listeners: dict[int, Callable[[Heard], None]] = {}

    async def begin(self) -> None:
        """Create the session. Raises RelayRefused, RelaySilent, RelayUnreachable, as all requests do."""
        answer = await self._ask("create")
        self._session = _identifier(answer)

    async def attach(self, listener: Callable[[Heard], None]) -> int:
        """Return a new handle of the video room; `listener` gets its events."""
        handle = _identifier(await self._ask("attach", plugin=VIDEO_ROOM))
        self._listeners[handle] = listener
        return handle

    async def detach(self, handle: int) -> None:
        self._listeners.pop(handle, None)
        await self._ask("detach", handle_id=handle)

    async def message(self, handle: int, body: Mapping[str, object], jsep: Mapping[str, str] | None = None) -> Heard:
        """Send a request to the plugin and return its answer."""
        return await self._ask("message", handle_id=handle, body=dict(body), jsep=jsep and dict(jsep))

    async def _ask(self, kind: str, **fields: Any) -> Heard:
        transaction = f"{self._prefix}-{next(self._numbers)}"
        answer: asyncio.Future[Heard] = asyncio.get_running_loop().create_future()
        self._waiting[transaction] = answer, kind == "keepalive"
        try:
            if self.ended.is_set():
                raise RelayUnreachable(self.why)
            await self._socket.send(janus_request(kind, transaction, session_id=self._session, **fields))
            async with asyncio.timeout(ANSWER_SECONDS):
                heard = await answer
        except TimeoutError as error:
            raise RelaySilent(f"no answer to {kind} within {ANSWER_SECONDS:g} s") from error
        except WebSocketException as error:
            raise RelayUnreachable("the connection was closed") from error
        finally:
            del self._waiting[transaction]
        if heard.kind == "error":
            raise RelayRefused(heard.detail, heard.code)
        return heard

    async def listen(self) -> None:
        """Receive messages until cancelled, or the connection ends."""
        try:
            async for text in self._socket:
                try:
                    self._heard(parse_janus(text))
                except MessageError:
                    self.malformed += 1
        except WebSocketException:
            pass  # told below
        self._end("the connection was closed")

    async def keep_alive(self) -> None:
        """Send keepalives until cancelled; end the session when the relay does not answer."""
        while not self.ended.is_set():
            await asyncio.sleep(KEEPALIVE_SECONDS)
            if self._session is None:
                continue
            try:
                await self._ask("keepalive")
            except (RelaySilent, RelayRefused, RelayUnreachable) as error:
                self._end(error.detail)

    def _heard(self, heard: Heard) -> None:
        waiting = self._waiting.get(heard.transaction)
        if waiting is not None:
            answer, acknowledged = waiting
            if not answer.done() and (acknowledged or heard.kind != "ack"):
                answer.set_result(heard)
        elif heard.handle in self._listeners:
            self._listeners[heard.handle](heard)
        elif heard.kind == "ended" and heard.handle == 0:
            self._end(heard.detail)

    def _end(self, why: str) -> None:
        if self.ended.is_set():
            return
        self.why = why
        self.ended.set()
        for answer, _ in self._waiting.values():
            if not answer.done():
                answer.set_exception(RelayUnreachable(why))


def _identifier(answer: Heard) -> int:
    found = answer.data.get("id")
    if not isinstance(found, int):
        raise RelayRefused("the relay's answer has no id")
    return found
