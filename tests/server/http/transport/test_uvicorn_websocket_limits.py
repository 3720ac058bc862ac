"""Floods of WebSocket frames: on the protocol itself with a socket of the test, and over real TCP."""

import asyncio
from contextlib import suppress
from typing import Any

import pytest
import uvicorn
from uvicorn.server import ServerState
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosedError
from websockets.frames import Frame, Opcode

from lockstep.protocol.pacing.paced_reader import PIECE
from lockstep.server.http.transport import uvicorn_websocket_limits
from lockstep.server.http.transport.uvicorn_websocket_limits import (
    FRAME_BURST,
    LAST_WORDS,
    SOCKET,
    BoundedWebSocket,
)
from tests.server.rig import PATIENCE, eventually, running_rig
from tests.server.watch_lines import NOWHERE, address, joined, ticket

EMPTY = b"\x82\x80\x00\x00\x00\x00"  # a masked binary frame without data
READ = 256 * 1024  # bytes that an event loop reads at once
ONE_PIECE = PIECE // len(EMPTY) + 1  # frames


class Socket(asyncio.Transport):
    def __init__(self) -> None:
        super().__init__()
        self.written = b""
        self.is_reading_now = True
        self.closed = self.aborted = False
        self.gone = asyncio.Event()  # set when it was closed

    def write(self, data: bytes | bytearray | memoryview) -> None:
        self.written += bytes(data)

    def is_closing(self) -> bool:
        return self.closed

    def close(self) -> None:
        self.closed = True
        self.gone.set()

    def abort(self) -> None:
        self.closed = self.aborted = True
        self.gone.set()

    def pause_reading(self) -> None:
        self.is_reading_now = False

    def resume_reading(self) -> None:
        self.is_reading_now = True

    def set_write_buffer_limits(self, high: int | None = None, low: int | None = None) -> None: ...


class Link(asyncio.Protocol):
    def __init__(self, enough: int = 0) -> None:
        self.messages = 0
        self.has_enough = asyncio.Event()
        self._enough = enough

    def data_received(self, data: bytes) -> None:
        self.messages += 1
        if self.messages == self._enough:
            self.has_enough.set()


class Server:
    """One connection whose app does what the test does."""

    def __init__(self, path: str = "/dial/operator", headers: str = "") -> None:
        self.done = asyncio.Event()
        self.socket = Socket()
        config = uvicorn.Config(self._app, ws=BoundedWebSocket, interface="asgi3", log_level="critical")
        config.load()
        self.connection = BoundedWebSocket(config, ServerState(), {})
        self.connection.connection_made(self.socket)
        self.connection.data_received(
            f"GET {path} HTTP/1.1\r\nHost: a\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            f"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n{headers}\r\n".encode()
        )

    async def _app(self, scope: Any, receive: Any, send: Any) -> None:
        await self.done.wait()

    async def accepted(self) -> BoundedWebSocket:
        assert (await self.connection.receive())["type"] == "websocket.connect"
        await self.connection.send({"type": "websocket.accept"})
        return self.connection

    async def end(self) -> None:
        self.done.set()
        self.connection.connection_lost(None)
        await asyncio.gather(*self.connection.tasks)

    def fault(self) -> Exception | None:
        """What the parser found wrong."""
        return self.connection.conn.parser_exc

    @property
    def code(self) -> int:
        """Of the console's close frame, the last that it has written."""
        found = self.socket.written.rpartition(b"\x88")[2]
        return int.from_bytes(found[1:3])


async def test_what_comes_at_once_is_parsed_no_further_than_one_piece_before_the_app_has_had_it() -> None:
    server = Server("/watch/x")
    connection = await server.accepted()
    connection.data_received(EMPTY * (READ // len(EMPTY)))
    assert connection.queue.qsize() <= ONE_PIECE
    assert not server.socket.is_reading_now
    await server.end()


async def test_the_app_gets_each_message_in_a_turn_of_its_own() -> None:
    server = Server("/watch/x")
    connection = await server.accepted()
    connection.data_received(EMPTY * 100)
    turns = 0

    def another() -> None:
        nonlocal turns
        turns += 1
        loop.call_soon(another)

    loop = asyncio.get_running_loop()
    loop.call_soon(another)
    for _ in range(100):
        assert (await connection.receive())["type"] == "websocket.receive"
    assert turns >= 100
    await server.end()


async def test_nothing_is_parsed_before_the_app_accepts() -> None:
    server = Server()
    server.connection.data_received(b"\xff" * READ)
    assert server.fault() is None
    assert not server.socket.is_reading_now
    await server.accepted()
    await asyncio.sleep(0)
    assert server.fault() is not None
    await server.end()


async def test_after_the_end_no_more_is_read_than_the_clients_last_words(monkeypatch: pytest.MonkeyPatch) -> None:
    server = Server("/watch/x")
    connection = await server.accepted()
    await connection.send({"type": "websocket.close", "code": 1000})
    parse, sizes = connection.conn.receive_data, list[int]()

    def counted(data: bytes | bytearray) -> None:
        sizes.append(len(data))
        parse(data)

    monkeypatch.setattr(connection.conn, "receive_data", counted)
    connection.data_received(EMPTY * (READ // len(EMPTY)))
    async with asyncio.timeout(PATIENCE):
        await server.socket.gone.wait()
    assert sum(sizes) <= LAST_WORDS
    connection.data_received(EMPTY)
    assert sum(sizes) <= LAST_WORDS
    await server.end()


async def test_a_clients_reply_to_the_close_ends_the_connection() -> None:
    server = Server("/watch/x")
    connection = await server.accepted()
    await connection.send({"type": "websocket.close", "code": 1000})
    connection.data_received(EMPTY + Frame(Opcode.CLOSE, b"\x03\xe8").serialize(mask=True))
    assert server.socket.closed
    assert not server.socket.aborted
    await server.end()


@pytest.mark.parametrize("data", [EMPTY * 3, Frame(Opcode.BINARY, b"x" * 3000).serialize(mask=True)])
async def test_whoever_may_say_little_is_refused_with_the_first_that_is_too_much(data: bytes) -> None:
    server = Server("/dial/pair")
    server.connection.expect(messages=2, size=2048)
    connection = await server.accepted()
    assert SOCKET in connection.scope["extensions"]
    connection.data_received(data + EMPTY * (READ // len(EMPTY)))
    assert server.socket.closed
    assert server.code in (1008, 1009)
    await server.end()


async def test_a_link_gets_the_empty_frames_of_one_piece_in_a_turn_and_the_next_turn_comes_later(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("lockstep.protocol.pacing.paced_reader.READ_TURN", 1e-9)
    server, link = Server(), Link()
    (await server.accepted()).carry(link)
    server.connection.data_received(EMPTY * (READ // len(EMPTY)))
    assert 0 < link.messages <= ONE_PIECE
    assert not server.socket.is_reading_now
    await server.end()
    read = link.messages
    await asyncio.sleep(0)
    assert link.messages == read


async def test_a_link_of_too_many_frames_a_second_is_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(uvicorn_websocket_limits, "LINK_RATE", 0.001)
    monkeypatch.setattr(uvicorn_websocket_limits, "LINK_BURST", 1000.0)
    server, link = Server(), Link()
    (await server.accepted()).carry(link)
    server.connection.data_received(EMPTY * (READ // len(EMPTY)))
    async with asyncio.timeout(PATIENCE):
        await server.socket.gone.wait()
    assert server.code == 1008
    assert link.messages == 1000
    await server.end()


async def test_a_link_that_pauses_gets_nothing_until_it_goes_on() -> None:
    class Slow(Link):
        def connection_made(self, transport: asyncio.BaseTransport) -> None:
            self.transport = transport

        def data_received(self, data: bytes) -> None:
            super().data_received(data)
            if self.messages == 1:
                self.transport.pause_reading()  # type: ignore[attr-defined]

    server, link = Server(), Slow(enough=3)
    (await server.accepted()).carry(link)
    frame = Frame(Opcode.BINARY, b"x" * PIECE).serialize(mask=True)
    server.connection.data_received(frame * 3)
    await asyncio.sleep(0)
    assert link.messages == 1
    assert not server.socket.is_reading_now
    link.transport.resume_reading()  # type: ignore[attr-defined]
    async with asyncio.timeout(PATIENCE):
        await link.has_enough.wait()
    await server.end()


async def test_a_request_that_http_takes_and_the_websocket_does_not_leaves_no_connection_behind() -> None:
    async with running_rig() as rig:
        host, port = rig.url.removeprefix("http://").split(":")
        reader, writer = await asyncio.open_connection(host, int(port))
        many = "".join(f"X-{number}: a\r\n" for number in range(200))
        writer.write(
            f"GET /watch/x HTTP/1.1\r\nHost: {host}:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            f"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n{many}\r\n".encode()
        )
        async with asyncio.timeout(PATIENCE):
            with suppress(ConnectionError):
                assert await reader.read() == b""
        writer.close()


async def test_a_flood_of_empty_messages_ends_an_observers_line_by_name(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(uvicorn_websocket_limits, "FRAME_RATE", 0.001)
    async with running_rig(relay=NOWHERE, observers_direct=0, max_observer_rate=1e6, max_bad_messages=10**6) as rig:
        async with joined(address(rig, await ticket(rig))) as line:
            line.transport.write(Frame(Opcode.TEXT, b"").serialize(mask=True) * int(4 * FRAME_BURST))
            async with asyncio.timeout(PATIENCE):
                with suppress(ConnectionClosedError):
                    async for _ in line:
                        pass  # what the console answers
        await eventually(lambda: len(rig.dependencies.console.peers) == 0)
        assert rig.count("lockstep_bad_input_total", where="transport", reason="too_many_frames") == 1


async def test_an_honest_client_hears_the_close_code_at_once() -> None:
    async with (
        running_rig(relay=NOWHERE, observers_direct=0, peer_silence=0.1) as rig,
        connect(address(rig, await ticket(rig)), proxy=None, ping_interval=None, close_timeout=None) as line,
    ):
        async with asyncio.timeout(PATIENCE):
            await line.wait_closed()
        assert (line.close_code, line.close_reason) == (1000, "silent")
