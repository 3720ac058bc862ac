"""Raw connections to a console that bounds them."""

import asyncio
import datetime
import itertools
import math
import os
import socket
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from lockstep.protocol.console import Welcome
from lockstep.server.auth.tokens import Identity
from lockstep.server.http import request_body
from lockstep.server.http.transport import uvicorn_http_limits
from lockstep.server.http.transport.connection_places import ConnectionPlaces, Place
from lockstep.server.http.transport.tls import self_signed
from lockstep.server.http.trusted_host import PATIENCE as PATIENCE_OF_THE_DOOR
from lockstep.server.util.fair_queue import FairQueue
from tests.server.rig import PATIENCE, Rig, eventually, running_bridge, running_console, running_rig
from tests.server.watch_lines import NOWHERE, open_line

HEAD = b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n"


@asynccontextmanager
async def bounded_console(**settings: Any) -> AsyncIterator[tuple[Rig, int]]:
    """A console, and its port."""
    async with running_bridge() as bridge, running_console(bridge.address[1], **settings) as rig:
        yield rig, int(rig.url.rpartition(":")[2])


async def _said(reader: asyncio.StreamReader) -> bytes:
    """Until the other side closes."""
    async with asyncio.timeout(PATIENCE):
        try:
            return await reader.read()
        except ConnectionResetError:
            return b""


@pytest.mark.parametrize("beginning", [b"", b"G", HEAD])
async def test_a_head_that_does_not_come_ends_the_connection(beginning: bytes) -> None:
    async with bounded_console(request_timeout=0.2) as (rig, port):
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(beginning)
        assert await _said(reader) == b""
        writer.close()
        assert rig.count("lockstep_bad_input_total", where="http", reason="too_slow") == 1


async def test_a_second_head_on_the_same_connection_may_not_dawdle_either() -> None:
    async with bounded_console(request_timeout=0.2) as (rig, port):
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(HEAD + b"\r\n")
        async with asyncio.timeout(PATIENCE):
            await reader.readuntil(b"}")
        writer.write(HEAD)
        assert await _said(reader) == b""
        writer.close()
        assert rig.count("lockstep_bad_input_total", where="http", reason="too_slow") == 1


async def _answer_to_half_a_body(rig: Rig, port: int, asked: bytes) -> bytes:
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    head = HEAD.replace(b"GET /healthz", asked) + b"Authorization: " + rig.token("operator")["Authorization"].encode()
    writer.write(head + b"\r\nContent-Length: 9\r\n\r\n{")
    answer = await _said(reader)
    writer.close()
    return answer


async def test_a_body_that_does_not_come_is_refused_by_name() -> None:
    async with bounded_console(request_timeout=0.2) as (rig, port):
        assert b'"too_slow"' in await _answer_to_half_a_body(rig, port, b"POST /api/reset")
        assert rig.count("lockstep_bad_input_total", where="http", reason="too_slow") == 1


async def test_a_stop_whose_body_does_not_come_is_a_stop_all_the_same() -> None:
    async with bounded_console(request_timeout=0.2) as (rig, port):
        assert b'"delivered":true' in await _answer_to_half_a_body(rig, port, b"POST /api/stop")
        await eventually(lambda: rig.dependencies.console.clock.stop.stopped)
        assert rig.count("lockstep_bad_input_total", where="http", reason="too_slow") == 1


async def test_a_stop_does_not_wait_for_a_body_that_the_network_holds_up() -> None:
    async with bounded_console(request_timeout=3600) as (rig, port):
        head = HEAD.replace(b"GET /healthz", b"POST /api/stop")
        authorization = b"Authorization: " + rig.token("observer")["Authorization"].encode()
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(head + authorization + b"\r\nContent-Length: 9\r\n\r\n{")
        async with asyncio.timeout(PATIENCE):
            assert b'"delivered":true' in await reader.readuntil(b"}")
            await eventually(lambda: rig.dependencies.console.clock.stop.stopped)
            writer.write(b'"a": 10}' + HEAD + b"\r\n")
            assert b'"robot_link"' in await reader.readuntil(b"}"), "the connection serves on"
        writer.close()
        assert rig.count("lockstep_bad_input_total", where="http", reason="too_slow") == 1


async def test_a_head_that_is_too_large_is_refused() -> None:
    async with bounded_console() as (_, port):
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(HEAD + b"X-Long: " + b"x" * 20_000)
        assert (await _said(reader)).startswith(b"HTTP/1.1 400")
        writer.close()


BROKEN_CHUNK = b"Transfer-Encoding: chunked\r\n\r\nzz\r\n"


async def test_a_body_in_broken_chunks_is_refused_and_is_no_fault_of_the_console() -> None:
    async with bounded_console() as (rig, port):
        for path in (b"/whep", b"/api/stop", b"/api/reset", b"/nothing"):
            head = HEAD.replace(b"GET /healthz", b"POST " + path)
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            writer.write(head + BROKEN_CHUNK)
            assert (await _said(reader)).startswith(b"HTTP/1.1 4")
            writer.close()
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            writer.write(head + BROKEN_CHUNK[:-4])
            await writer.drain()
            async with asyncio.timeout(PATIENCE):
                await reader.readuntil(b"}")  # it has no token: that is said before the body has come
            writer.write(BROKEN_CHUNK[-4:])
            assert await _said(reader) == b""
            writer.close()
        await eventually(lambda: _refused(rig, "bad_request") == 8)
        assert not any(rig.count("lockstep_internal_errors_total", where=where) for where in ("http", "loop"))


async def test_a_stop_with_a_body_in_broken_chunks_is_a_stop_all_the_same() -> None:
    async with bounded_console() as (rig, port):
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        head = HEAD.replace(b"GET /healthz", b"POST /api/stop")
        writer.write(
            head + b"Authorization: " + rig.token("observer")["Authorization"].encode() + b"\r\n" + BROKEN_CHUNK
        )
        assert (await _said(reader)).startswith(b"HTTP/1.1 400")
        writer.close()
        await eventually(lambda: rig.dependencies.console.clock.stop.stopped)
        assert not any(rig.count("lockstep_internal_errors_total", where=where) for where in ("http", "loop"))


def _refused(rig: Rig, reason: str) -> float:
    return rig.count("lockstep_bad_input_total", where="http", reason=reason)


async def _open(port: int, beginning: bytes = b"") -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    writer.write(beginning)
    await writer.drain()
    return reader, writer


async def _answer(reader: asyncio.StreamReader) -> bytes:
    """The head of the next one."""
    async with asyncio.timeout(PATIENCE):
        return await reader.readuntil(b"\r\n\r\n")


async def test_when_there_is_no_place_the_oldest_stranger_goes_and_not_the_newcomer() -> None:
    async with bounded_console(max_connections=3) as (rig, port):
        held = [await _open(port, HEAD) for _ in range(3)]
        await eventually(lambda: len(rig.app.state.connection_places) == 3)
        reader, writer = await _open(port, HEAD + b"\r\n")
        assert (await _answer(reader)).startswith(b"HTTP/1.1 200")
        assert await _said(held[0][0]) == b""
        assert rig.count("lockstep_bad_input_total", where="http", reason="too_many_connections") == 1
        for still, other in held[1:]:
            other.write(b"Connection: close\r\n\r\n")
            assert (await _said(still)).startswith(b"HTTP/1.1 200")
        for _, each in (*held, (reader, writer)):
            each.close()
        await eventually(lambda: len(rig.app.state.connection_places) == 0)


async def test_who_brought_a_good_token_keeps_the_connection_when_strangers_take_all() -> None:
    async with bounded_console(max_connections=4) as (rig, port):
        token = rig.token("observer")["Authorization"].encode()
        reader, writer = await _open(port, HEAD + b"Authorization: " + token + b"\r\n\r\n")
        assert (await _answer(reader)).startswith(b"HTTP/1.1 200")
        strangers = [await _open(port) for _ in range(20)]
        await eventually(
            lambda: rig.count("lockstep_bad_input_total", where="http", reason="too_many_connections") == 17
        )
        await reader.readuntil(b"}")
        writer.write(HEAD + b"Authorization: " + token + b"\r\n\r\n")
        assert (await _answer(reader)).startswith(b"HTTP/1.1 200")
        for _, each in (*strangers, (reader, writer)):
            each.close()


async def test_a_proxy_on_this_machine_holds_as_many_connections_as_it_needs_and_nobody_else_does() -> None:
    async with bounded_console(max_connections=20, max_address_connections=2) as (rig, port):
        for address, most, turned_away in (("127.0.0.1", 6, 0), ("127.0.0.2", 2, 4)):
            held = [await asyncio.open_connection("127.0.0.1", port, local_addr=(address, 0)) for _ in range(6)]
            async with asyncio.timeout(PATIENCE):
                while len(rig.app.state.connection_places) + _refused(rig, "too_many_connections") < len(held):  # noqa: ASYNC110
                    await asyncio.sleep(0.01)
            assert (len(rig.app.state.connection_places), _refused(rig, "too_many_connections")) == (most, turned_away)
            for _, each in held:
                each.transport.abort()
            await eventually(lambda: len(rig.app.state.connection_places) == 0)


async def test_strangers_wait_for_their_pace_and_who_brings_a_good_token_does_not() -> None:
    async with bounded_console(max_stranger_burst=4, max_stranger_rate=0.001) as (rig, port):
        token = rig.token("observer")["Authorization"].encode()
        known, writer = await _open(port, HEAD + b"Authorization: " + token + b"\r\n\r\n")
        assert (await _answer(known)).startswith(b"HTTP/1.1 200")
        await known.readuntil(b"}")
        stranger, other = await _open(port, HEAD + b"\r\n")
        assert (await _answer(stranger)).startswith(b"HTTP/1.1 200")
        await stranger.readuntil(b"}")
        other.write(HEAD + b"\r\n")
        waiting = asyncio.create_task(_answer(stranger))
        for _ in range(3):
            writer.write(HEAD + b"Authorization: " + token + b"\r\n\r\n")
            assert (await _answer(known)).startswith(b"HTTP/1.1 200")
            await known.readuntil(b"}")
        assert not waiting.done(), "it has used up what strangers have"
        waiting.cancel()
        for each in (writer, other):
            each.close()


async def test_each_request_of_those_that_come_together_has_a_turn_and_the_strangers_pace_holds_for_all() -> None:
    answered = 0

    async def count(reader: asyncio.StreamReader) -> None:
        nonlocal answered
        while True:
            await reader.readuntil(b"}")
            answered += 1

    async with bounded_console(max_stranger_burst=8, max_stranger_rate=0.001) as (rig, port):
        head = HEAD + b"Authorization: " + rig.token("observer")["Authorization"].encode() + b"\r\n\r\n"
        known, writer = await _open(port, head)
        await _answer(known)
        await known.readuntil(b"}")
        stranger, other = await _open(port, (HEAD + b"\r\n") * 20)
        counting = asyncio.create_task(count(stranger))
        await eventually(lambda: answered > 0)
        writer.write(head * 20)
        for _ in range(20):
            assert (await _answer(known)).startswith(b"HTTP/1.1 200"), "each is known by its own head"
            await known.readuntil(b"}")
        assert answered < 8, "it has used up what strangers have"
        counting.cancel()
        for each in (writer, other):
            each.close()


async def test_a_request_behind_another_comes_whole_though_its_end_comes_later() -> None:
    async with bounded_console() as (_, port):
        reader, writer = await _open(port, (HEAD + b"\r\n") * 2 + HEAD)
        for _ in range(2):
            assert (await _answer(reader)).startswith(b"HTTP/1.1 200")
            await reader.readuntil(b"}")
        writer.write(b"\r\n" + HEAD + b"\r\n")
        for _ in range(2):
            assert (await _answer(reader)).startswith(b"HTTP/1.1 200")
            await reader.readuntil(b"}")
        writer.close()


async def test_a_link_that_floods_comes_first_no_more_but_its_stops_do(monkeypatch: pytest.MonkeyPatch) -> None:
    """Else strangers would get no answer while it does: a page that somebody opens, a health check."""
    came_first: list[bool] = []
    ask = FairQueue.ask

    def spied(self: FairQueue, address: str, work: Callable[[], None], *, first: bool = False) -> None:
        came_first.append(first)
        ask(self, address, work, first=first)

    monkeypatch.setattr(FairQueue, "ask", spied)
    for name in ("LINK_RATE", "STOP_RATE"):
        monkeypatch.setattr(uvicorn_http_limits, name, 1e-6)
    monkeypatch.setattr(uvicorn_http_limits, "LINK_BURST", 2)
    monkeypatch.setattr(uvicorn_http_limits, "STOP_BURST", 3)
    async with bounded_console() as (rig, port):
        header = rig.token("observer")
        await rig.http.get("/api/session", headers=header)  # a token is known from its first use on
        token = b"Authorization: " + header["Authorization"].encode() + b"\r\n"
        reader, writer = await _open(port)
        stop = HEAD.replace(b"GET /healthz", b"POST /api/stop") + token + b"Content-Length: 2\r\n\r\n"
        came_first.clear()
        for _ in range(3):
            writer.write(HEAD + token + b"\r\n")
            await _answer(reader)
            await reader.readuntil(b"}")
        assert came_first == [True, True, False]
        came_first.clear()
        writer.write(stop)
        await eventually(lambda: len(came_first) == 1)
        writer.write(b"{}")
        await _answer(reader)
        writer.close()
        assert came_first == [True, True]
        await eventually(lambda: rig.dependencies.console.clock.stop.stopped)


async def test_a_link_that_has_ended_is_a_strangers_and_no_longer_comes_first() -> None:
    async with bounded_console() as (rig, port):
        token = rig.access.sign(Identity("observer", "x", "id", time.time() + 3600), time.time())
        request = HEAD + b"Authorization: Bearer " + token.encode() + b"\r\n\r\n"
        reader, writer = await _open(port, request)
        assert (await _answer(reader)).startswith(b"HTTP/1.1 200")
        await reader.readuntil(b"}")
        assert token in rig.app.state.known_tokens
        assert rig.app.state.connection_places.known == 1
        assert rig.dependencies.state.invitations.revoked_elsewhere({"id": math.inf})
        writer.write(request)
        assert (await _answer(reader)).startswith(b"HTTP/1.1 200")
        assert token not in rig.app.state.known_tokens
        assert rig.app.state.connection_places.known == 0
        writer.close()


async def test_a_body_that_was_announced_does_not_keep_a_connection_that_was_answered() -> None:
    """One byte of it ends the server's own timer between two requests."""
    async with bounded_console(request_timeout=1.5) as (rig, port):
        reader, writer = await _open(
            port, HEAD.replace(b"GET /healthz", b"POST /api/stop") + b"Content-Length: 9\r\n\r\n"
        )
        assert (await _answer(reader)).startswith(b"HTTP/1.1 401")
        writer.write(b"{")
        await _said(reader)
        writer.close()
        assert rig.count("lockstep_bad_input_total", where="http", reason="too_slow") == 1


async def test_one_deadline_holds_for_head_and_body_together(monkeypatch: pytest.MonkeyPatch) -> None:
    """That of the body is counted from the first byte of the head."""
    deadlines: list[float] = []
    original = request_body.deadline

    def spied(request: Any) -> float:
        deadlines.append(original(request))
        return deadlines[-1]

    monkeypatch.setattr(request_body, "deadline", spied)
    seconds = 100.0
    async with bounded_console(request_timeout=seconds) as (rig, port):
        token = rig.token("observer")["Authorization"].encode()
        reader, writer = await _open(port, HEAD.replace(b"GET /healthz", b"POST /api/stop"))
        await eventually(lambda: len(rig.app.state.connection_places) == 1)
        head_came_whole = asyncio.get_running_loop().time()
        writer.write(b"Authorization: " + token + b"\r\nContent-Length: 2\r\nConnection: close\r\n\r\n{}")
        assert b"HTTP/1.1 " in await _said(reader)
        writer.close()
        assert len(deadlines) == 1
        assert deadlines[0] - seconds < head_came_whole


async def test_who_does_not_read_its_answer_loses_the_connection() -> None:
    async with bounded_console(request_timeout=0.2) as (rig, port):
        held = socket.socket()
        held.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        held.setblocking(False)
        loop = asyncio.get_running_loop()
        with held:
            await loop.sock_connect(held, ("127.0.0.1", port))
            token = rig.token("supervisor")["Authorization"].encode()
            request = b"GET /openapi.json HTTP/1.1\r\nHost: localhost\r\nAuthorization: " + token + b"\r\n\r\n"
            await loop.sock_sendall(held, request * 200)
            await eventually(lambda: rig.count("lockstep_bad_input_total", where="http", reason="does_not_read") == 1)


@pytest.mark.parametrize(
    ("taken", "stays"), [(uvicorn_http_limits.LEAST_READ // 2, False), (uvicorn_http_limits.LEAST_READ, True)]
)
async def test_an_answer_has_to_be_read_so_fast(taken: int, stays: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    served = ConnectionPlaces.serve

    def serve(self: ConnectionPlaces, place: Place, address: str, link: str) -> bool:
        place.close.__self__.get_write_buffer_size = size  # type: ignore[attr-defined]
        return served(self, place, address, link)

    monkeypatch.setattr(ConnectionPlaces, "serve", serve)
    unread = itertools.count(10_000_000, -taken)  # bytes that the client has not taken, at each look
    looked = asyncio.Event()

    def size() -> int:
        left = next(unread)
        if left <= 10_000_000 - 5 * taken:
            looked.set()
        return left

    async with bounded_console(request_timeout=0.1) as (rig, port):
        reader, writer = await _open(port, HEAD + b"\r\n")
        await _answer(reader)
        if stays:
            async with asyncio.timeout(PATIENCE):
                await looked.wait()
        else:
            await eventually(lambda: _refused(rig, "does_not_read") == 1)
        assert _refused(rig, "does_not_read") == (not stays)
        writer.close()


async def test_who_is_turned_away_again_and_again_has_the_connection_closed() -> None:
    async with bounded_console() as (_, port):
        reader, writer = await _open(port)
        answers = []
        for _ in range(PATIENCE_OF_THE_DOOR):
            writer.write(b"GET /api/session HTTP/1.1\r\nHost: localhost\r\n\r\n")
            answers.append(await _answer(reader))
            await reader.readuntil(b"}")
        assert [b"connection: close" in each.lower() for each in answers] == [False] * (PATIENCE_OF_THE_DOOR - 1) + [
            True
        ]
        assert await _said(reader) == b""
        writer.close()


async def test_what_is_no_http_is_counted_and_closed() -> None:
    async with bounded_console() as (rig, port):
        reader, writer = await _open(port, b"\x16\x03\x01 what\r\n\r\n")
        assert (await _said(reader)).startswith(b"HTTP/1.1 400")
        writer.close()
        assert rig.count("lockstep_bad_input_total", where="http", reason="bad_request") == 1


async def test_silent_tls_connections_hold_no_more_than_their_places_and_a_stop_gets_through(tmp_path: Path) -> None:
    names = {"localhost", "127.0.0.1"}
    certificate = self_signed(tmp_path, names, datetime.datetime.now(datetime.UTC))
    async with bounded_console(certificate=certificate, max_connections=20) as (rig, port):
        await rig.dependencies.console.robot.reached.wait()
        before = len(os.listdir("/proc/self/fd"))
        silent = [await asyncio.open_connection("127.0.0.1", port) for _ in range(100)]
        await eventually(
            lambda: rig.count("lockstep_bad_input_total", where="http", reason="too_many_connections") >= 80
        )
        assert len(rig.app.state.connection_places) <= 20
        answer = await rig.http.post("/api/stop", headers=rig.token("observer"))
        assert (answer.status_code, len(rig.app.state.connection_places)) == (200, 20)
        assert len(os.listdir("/proc/self/fd")) <= before + len(silent) + 20 + 10, "those turned away hold nothing"
        for _, writer in silent:
            writer.transport.abort()


async def test_a_tls_handshake_that_never_ends_is_ended(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("lockstep.server.http.transport.acceptor.HANDSHAKE_SECONDS", 0.2)
    certificate = self_signed(tmp_path, {"localhost"}, datetime.datetime.now(datetime.UTC))
    async with bounded_console(certificate=certificate) as (rig, port):
        reader, writer = await _open(port)
        assert await _said(reader) == b""
        writer.close()
        assert rig.count("lockstep_bad_input_total", where="http", reason="no_handshake") == 1
        assert len(rig.app.state.connection_places) == 0


async def test_a_line_of_an_observer_gives_back_the_place_that_its_request_had() -> None:
    """Lines last for hours and are bounded by themselves; requests, STOP among them, need the places."""
    async with running_rig(relay=NOWHERE, observers_direct=0) as rig, open_line(rig) as line:
        await line.until(lambda each: isinstance(each, Welcome))
        assert len(rig.app.state.connection_places) == 1  # of the request for the ticket, which is kept alive
