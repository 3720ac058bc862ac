"""A peer that sends without end on a WebSocket, and the others on the loop."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st
from websockets.asyncio.client import connect
from websockets.asyncio.server import ServerConnection, serve

from lockstep.client.console_url import parse_link
from lockstep.client.transport.message_turns import MAX_UNREAD, MOST, MessageTurns, in_turns
from lockstep.client.transport.paced_connection import PacedConnection
from lockstep.client.transport.websocket_transport import WebSocketTransport
from lockstep.client.transport.whep import Whep
from tests.waiting import PATIENCE

pytestmark = pytest.mark.slow  # real connections that are flooded

PIECE = b"\x81\x02{}" * 10_000  # so many text messages "{}", unmasked, as a server sends them
FEW = 5 * MOST  # messages that are looked at


@asynccontextmanager
async def _flooding() -> AsyncIterator[int]:
    """A server that sends small messages without end, many in one packet. Yields its port."""

    async def flood(connection: ServerConnection) -> None:
        reading = asyncio.create_task(connection.wait_closed())
        while not reading.done():
            with suppress(RuntimeError):  # it is closing
                connection.transport.write(PIECE)
            await asyncio.sleep(0)
            while connection.transport.get_write_buffer_size() > len(PIECE) and not reading.done():  # noqa: ASYNC110
                await asyncio.sleep(0.001)  # until TCP has taken it

    async with serve(flood, "127.0.0.1", 0) as server:
        yield next(iter(server.sockets)).getsockname()[1]


class _Flooded:
    """Counts the messages between two turns of another task on the loop."""

    def __init__(self) -> None:
        self.messages = 0
        self.most = 0
        self.done = asyncio.Event()

    def take(self, _: str | bytes) -> None:
        self.messages += 1
        if self.messages >= FEW:
            self.done.set()

    async def look(self) -> None:
        while not self.done.is_set():
            before = self.messages
            await asyncio.sleep(0)
            self.most = max(self.most, self.messages - before)


async def _watch(flooded: _Flooded, running: Callable[[], Awaitable[None]]) -> None:
    async with asyncio.timeout(PATIENCE), asyncio.TaskGroup() as tasks:
        tasks.create_task(flooded.look())
        reading = asyncio.ensure_future(running())
        await flooded.done.wait()
        reading.cancel()
        with suppress(asyncio.CancelledError):
            await reading
    assert flooded.messages >= FEW
    assert 0 < flooded.most <= MOST


async def test_a_console_that_sends_an_observer_messages_without_end_leaves_the_loop_to_others(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async def ticket(*_: object) -> str:
        return "ticket"

    monkeypatch.setattr(Whep, "watch", ticket)
    flooded = _Flooded()
    async with _flooding() as port:
        link = parse_link(f"http://127.0.0.1:{port}/#token=x")
        line = WebSocketTransport(link, "0", None, flooded.take, PATIENCE)
        try:
            await line.negotiate()
            await _watch(flooded, line.run)
        finally:
            await line.close()


async def test_a_relay_that_sends_messages_without_end_leaves_the_loop_to_others() -> None:
    flooded = _Flooded()
    async with (
        _flooding() as port,
        connect(f"ws://127.0.0.1:{port}", max_queue=MAX_UNREAD, create_connection=PacedConnection) as socket,
    ):

        async def read() -> None:
            async for data in in_turns(socket.recv):
                flooded.take(data)

        await _watch(flooded, read)
        socket.transport.abort()  # the flood lets no close frame through


@given(st.lists(st.tuples(st.floats(0, 0.02), st.floats(0, 0.02)), min_size=1, max_size=300))
def test_messages_take_half_of_the_time_at_most_beside_one_turn(steps: list[tuple[float, float]]) -> None:
    """`steps`: s until a message comes, and s that it takes."""
    now = handled = 0.0
    turns = MessageTurns(now)
    for waited, took in steps:
        now += waited
        began, now = now, now + took
        handled += took
        pause = turns.handled(began, now)
        now += pause or 0.0
        assert handled <= now / 2 + 0.005 + 1e-9


def test_messages_that_come_now_and_then_are_not_held_back() -> None:
    turns = MessageTurns(0.0)
    pauses = [turns.handled(number * 0.04, number * 0.04 + 0.001) for number in range(1, MOST)]
    assert set(pauses) == {None}
    assert turns.handled(MOST * 0.04, MOST * 0.04 + 0.001) == 0.0
