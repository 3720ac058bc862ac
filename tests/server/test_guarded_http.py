"""Raw connections to a console that bounds them."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import httpx
import pytest

from server.guarded_http import ConnectionBounds
from tests.server.rig import PATIENCE, Rig, running_bridge, running_console

HEAD = b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n"


@asynccontextmanager
async def guarded_console(**settings: Any) -> AsyncIterator[tuple[Rig, int]]:
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
    async with guarded_console(request_timeout=0.2) as (rig, port):
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(beginning)
        assert await _said(reader) == b""
        writer.close()
        assert rig.count("lockstep_bad_input_total", where="http", reason="too_slow") == 1


async def test_a_second_head_on_the_same_connection_may_not_dawdle_either() -> None:
    async with guarded_console(request_timeout=0.2) as (rig, port):
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(HEAD + b"\r\n")
        async with asyncio.timeout(PATIENCE):
            await reader.readuntil(b'"detail":""}')
        writer.write(HEAD)
        assert await _said(reader) == b""
        writer.close()
        assert rig.count("lockstep_bad_input_total", where="http", reason="too_slow") == 1


async def test_a_body_that_does_not_come_is_refused_by_name() -> None:
    async with guarded_console(request_timeout=0.2) as (rig, port):
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        token = rig.token("observer")["Authorization"].encode()
        head = HEAD.replace(b"GET /healthz", b"POST /api/stop") + b"Authorization: " + token
        writer.write(head + b"\r\nContent-Length: 9\r\n\r\n{")
        assert b'"too_slow"' in await _said(reader)
        writer.close()


async def test_a_head_that_is_too_large_is_refused() -> None:
    async with guarded_console() as (_, port):
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(HEAD + b"X-Long: " + b"x" * 20_000)
        assert (await _said(reader)).startswith(b"HTTP/1.1 400")
        writer.close()


async def test_an_address_gets_only_so_many_connections_and_gets_them_back() -> None:
    async with guarded_console(max_address_connections=2) as (rig, port):
        held = [await asyncio.open_connection("127.0.0.1", port) for _ in range(2)]
        for _, writer in held:
            writer.write(HEAD)
            await writer.drain()
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        assert await _said(reader) == b""
        writer.close()
        assert rig.count("lockstep_bad_input_total", where="http", reason="too_many_connections") == 1
        for reader, writer in held:
            writer.write(b"Connection: close\r\n\r\n")
            assert (await _said(reader)).startswith(b"HTTP/1.1 200")
            writer.close()
        async with httpx.AsyncClient(trust_env=False) as http:
            assert (await http.get(f"http://127.0.0.1:{port}/healthz")).status_code == 200


def test_places_are_counted_in_all_and_by_address() -> None:
    refused: list[str] = []
    bounds = ConnectionBounds(3, 2, refused.append)
    assert [bounds.enter(each) for each in "aaabb"] == [True, True, False, True, False]
    assert refused == ["too_many_connections"] * 2
    bounds.leave("a")
    assert bounds.enter("b")
    for address in "abb":
        bounds.leave(address)
    assert len(bounds) == 0
