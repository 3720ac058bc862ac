"""The robot's WebSocket to its console, with a socket of the test."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import suppress

import pytest
from websockets.asyncio.server import serve
from websockets.client import ClientProtocol
from websockets.protocol import State
from websockets.uri import parse_uri

from lockstep.protocol.pacing.paced_reader import PIECE
from lockstep.robot_bridge.dial.console_connection import MAX_PINGS, ConsoleConnection, open_connection
from lockstep.robot_bridge.dial.opening_race import LATE, MOST
from lockstep.robot_bridge.errors import ConsoleUnreachable

EMPTY = b"\x82\x00"  # a binary frame without data, as a console sends it
PING = b"\x89\x00"


class Socket(asyncio.Transport):
    paused = False
    aborted = False

    def write(self, data: bytes | bytearray | memoryview) -> None: ...
    def set_write_buffer_limits(self, high: int | None = None, low: int | None = None) -> None: ...
    def close(self) -> None: ...

    def abort(self) -> None:
        self.aborted = True

    def can_write_eof(self) -> bool:
        return False

    def is_closing(self) -> bool:
        return False

    def pause_reading(self) -> None:
        self.paused = True

    def resume_reading(self) -> None:
        self.paused = False


class Link(asyncio.Protocol):
    messages = 0

    def data_received(self, data: bytes) -> None:
        self.messages += 1


async def test_a_console_that_floods_its_robot_with_empty_frames_has_a_piece_read_in_a_turn(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("lockstep.protocol.pacing.paced_reader.READ_TURN", 1e-9)
    connection = ConsoleConnection(ClientProtocol(parse_uri("ws://a/"), state=State.OPEN), for_link=True)
    connection.response = object()  # type: ignore[assignment]
    socket, link = Socket(), Link()
    connection.connection_made(socket)
    connection.carry(link)
    connection.data_received(EMPTY * 100_000)
    assert 0 < link.messages <= PIECE // len(EMPTY)
    assert socket.paused
    read = link.messages
    connection.eof_received()
    connection.connection_lost(None)
    await asyncio.sleep(0)
    assert link.messages == read


async def test_a_console_that_pings_and_takes_no_answers_loses_the_link_and_one_that_takes_them_does_not() -> None:
    connection = ConsoleConnection(ClientProtocol(parse_uri("ws://a/"), state=State.OPEN), for_link=True)
    connection.response = object()  # type: ignore[assignment]
    socket, link = Socket(), Link()
    connection.connection_made(socket)
    connection.carry(link)
    connection.data_received(PING * 2 * MAX_PINGS)
    connection.pause_writing()
    connection.data_received(PING * MAX_PINGS)
    connection.resume_writing()
    connection.pause_writing()
    connection.data_received(PING * MAX_PINGS)
    before = socket.aborted
    connection.data_received(PING)
    assert (before, socket.aborted) == (False, True)
    connection.connection_lost(None)


@pytest.fixture
async def console() -> AsyncIterator[tuple[str, list[asyncio.StreamWriter]]]:
    """Never answers on the first TCP connection, as where its answer got lost, and takes the others."""
    silent: list[asyncio.StreamWriter] = []
    async with serve(lambda websocket: websocket.wait_closed(), "127.0.0.1", 0) as answering:
        port = answering.sockets[0].getsockname()[1]

        async def take(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            if not silent:
                silent.append(writer)
                with suppress(ConnectionError):
                    await reader.read(-1)
                writer.close()
                return
            inner_reader, inner_writer = await asyncio.open_connection("127.0.0.1", port)
            await asyncio.gather(_pass_on(reader, inner_writer), _pass_on(inner_reader, writer))

        server = await asyncio.start_server(take, "127.0.0.1", 0)
        async with server:
            yield f"ws://127.0.0.1:{server.sockets[0].getsockname()[1]}/dial/operator", silent


async def _pass_on(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    with suppress(ConnectionError):
        while data := await reader.read(4096):
            writer.write(data)
    writer.close()


async def test_a_handshake_that_hangs_is_overtaken_by_another_and_given_up(
    console: tuple[str, list[asyncio.StreamWriter]],
) -> None:
    url, silent = console
    opened = await open_connection(url, None, seconds=20.0)
    assert len(silent) == 1
    async with asyncio.timeout(20):
        await silent[0].wait_closed()  # the robot has closed it
    await opened.close()


async def test_a_console_that_never_answers_is_unreachable_and_nothing_stays_open() -> None:
    left: list[asyncio.Task[None]] = []

    async def take(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        left.append(task)
        with suppress(ConnectionError):
            await reader.read(-1)
        writer.close()

    server = await asyncio.start_server(take, "127.0.0.1", 0)
    async with server:
        url = f"ws://127.0.0.1:{server.sockets[0].getsockname()[1]}/dial/operator"
        with pytest.raises(ConsoleUnreachable):
            await open_connection(url, None, seconds=4 * LATE)
        async with asyncio.timeout(20):
            await asyncio.gather(*left)
    assert 1 < len(left) <= MOST
