"""A real Caddy with the fleet's Caddyfile in front of two servers that say who they are."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import httpx

from lockstep.bench.harness.caddy import running_caddy
from lockstep.bench.harness.free_port import free_port

READY_SECONDS = 20.0


@asynccontextmanager
async def _console(name: str) -> AsyncIterator[asyncio.Server]:
    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.readuntil(b"\r\n\r\n")
        head = f"HTTP/1.1 200 OK\r\nContent-Length: {len(name)}\r\nConnection: close\r\n\r\n"
        writer.write(head.encode() + name.encode())
        await writer.drain()
        writer.close()

    server = await asyncio.start_server(answer, "127.0.0.1", 0)
    async with server:
        yield server


def _address(server: asyncio.Server) -> str:
    return f"127.0.0.1:{server.sockets[0].getsockname()[1]}"


@asynccontextmanager
async def _entry(directory: Path, one: asyncio.Server, two: asyncio.Server) -> AsyncIterator[httpx.AsyncClient]:
    https = free_port()
    async with (
        running_caddy("Caddyfile.fleet", directory, https, LOCKSTEP_ONE=_address(one), LOCKSTEP_TWO=_address(two)),
        httpx.AsyncClient(base_url=f"https://localhost:{https}", verify=False, trust_env=False) as http,
        asyncio.timeout(READY_SECONDS),
    ):
        while True:  # until it has a certificate
            try:
                await http.get("/")
            except httpx.TransportError:
                await asyncio.sleep(0.05)
            else:
                break
        yield http


async def test_robots_lead_to_their_consoles_and_the_overview_to_the_first_that_lives(tmp_path: Path) -> None:
    async with _console("one") as one, _console("two") as two, _entry(tmp_path, one, two) as http:
        for path, console in (
            ("/", "one"),
            ("/api/fleet", "one"),
            ("/robots/left/", "one"),
            ("/robots/right/whep", "one"),
            ("/robots/crane", "two"),
            ("/robots/crane/api/session", "two"),
            ("/robots/cranes/", "one"),
        ):
            assert (await http.get(path)).text == console, path
        for path in ("/metrics", "/robots/crane/metrics"):
            assert (await http.get(path)).status_code == 404
        one.close()
        await one.wait_closed()
        assert (await http.get("/api/fleet")).text == "two"
        assert (await http.get("/robots/left/")).status_code == 502
