"""Floods by who has no token, each held while somebody with one says STOP: plain, over TLS and behind Caddy."""

import asyncio
import datetime
import os
import shutil
import ssl
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest

from lockstep.bench.harness.free_port import free_port
from lockstep.server.http.transport.tls import Certificate, self_signed
from tests.server.rig import PATIENCE, Rig, eventually, running_bridge, running_console

CADDYFILE = Path(__file__).resolve().parents[3] / "deploy" / "Caddyfile"
PLACES = 16  # connections that the console takes
HELD = 48  # that the flood opens; an operating system would take thousands
POST = b"POST /api/stop HTTP/1.1\r\nHost: localhost\r\n"
STOPS = 5

Opened = tuple[asyncio.StreamReader, asyncio.StreamWriter]
Sends = Callable[[Opened], Awaitable[None]]


async def _silent(opened: Opened) -> None:
    """Says nothing."""


async def _half_a_head(opened: Opened) -> None:
    opened[1].write(POST)


async def _byte_at_a_time(opened: Opened) -> None:
    for byte in POST * 100:
        opened[1].write(bytes((byte,)))
        await opened[1].drain()
        await asyncio.sleep(0.02)


async def _slow_post(opened: Opened) -> None:
    opened[1].write(POST + b"Authorization: Bearer x\r\nContent-Length: 4000\r\n\r\n")
    for _ in range(4000):
        opened[1].write(b" ")
        await opened[1].drain()
        await asyncio.sleep(0.02)


def _again_and_again(request: bytes) -> Sends:
    async def send(opened: Opened) -> None:
        while not opened[0].at_eof():
            opened[1].write(request)
            await opened[1].drain()
            await opened[0].read(65_536)

    return send


def _get(path: str, host: str = "localhost") -> bytes:
    return f"GET {path} HTTP/1.1\r\nHost: {host}\r\n\r\n".encode()


async def _no_reader(opened: Opened) -> None:
    opened[0]._transport.pause_reading()  # type: ignore[attr-defined]
    for _ in range(200):
        opened[1].write(_get("/openapi.json"))
    await asyncio.Event().wait()


FLOODS: dict[str, Sends] = {
    "silent": _silent,
    "half a head": _half_a_head,
    "a byte at a time": _byte_at_a_time,
    "slow post": _slow_post,
    "stop without a token": _again_and_again(POST + b"Content-Length: 0\r\n\r\n"),
    "health": _again_and_again(_get("/healthz")),
    "not found": _again_and_again(_get("/nowhere")),
    "foreign name": _again_and_again(_get("/", "evil.example")),
    "no http": _again_and_again(b"what\r\n\r\n"),
    "no reader": _no_reader,
}


async def _attack(port: int, sends: Sends, tls: ssl.SSLContext | None, begun: list[int]) -> None:
    """One connection after the other, until cancelled."""
    while True:
        try:
            name = None if tls is None else "localhost"
            opened = await asyncio.open_connection("127.0.0.1", port, ssl=tls, server_hostname=name)
        except (OSError, ssl.SSLError):
            await asyncio.sleep(0.05)
            continue
        begun.append(port)
        try:
            await sends(opened)
            await opened[0].read()
        except (OSError, ssl.SSLError):
            await asyncio.sleep(0.01)
        finally:
            opened[1].transport.abort()


@asynccontextmanager
async def _flood(port: int, sends: Sends, tls: ssl.SSLContext | None) -> AsyncIterator[list[int]]:
    """Many connections at once; entered when each has begun."""
    begun: list[int] = []
    tasks = [asyncio.create_task(_attack(port, sends, tls, begun)) for _ in range(HELD)]
    try:
        async with asyncio.timeout(60):
            while len(begun) < HELD:  # noqa: ASYNC110
                await asyncio.sleep(0.01)
        yield begun
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


def _trusting() -> ssl.SSLContext:
    context = ssl.create_default_context()
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    return context


@asynccontextmanager
async def _console(certificate: Certificate | None = None) -> AsyncIterator[Rig]:
    given: dict[str, Any] = {"max_connections": PLACES, "max_address_connections": PLACES // 2, "request_timeout": 3.0}
    async with (
        running_bridge() as bridge,
        running_console(bridge.address[1], certificate=certificate, **given) as rig,
    ):
        async with asyncio.timeout(PATIENCE):
            await rig.dependencies.console.robot.reached.wait()
        yield rig


@asynccontextmanager
async def _caddy(rig: Rig, folder: Path) -> AsyncIterator[int]:
    """Caddy with our Caddyfile in front; its TLS port."""
    https = free_port()
    settings = {"LOCKSTEP_SITE": "localhost", "LOCKSTEP_PORT": rig.url.rpartition(":")[2]}
    ports = {"LOCKSTEP_HTTPS_PORT": str(https), "LOCKSTEP_HTTP_PORT": str(free_port())}
    folders = {"HOME": str(folder), "XDG_DATA_HOME": str(folder), "XDG_CONFIG_HOME": str(folder)}
    process = await asyncio.create_subprocess_exec(
        *("caddy", "run", "--config", str(CADDYFILE), "--adapter", "caddyfile"),
        env=os.environ | settings | ports | folders,
        stderr=asyncio.subprocess.DEVNULL,
    )
    try:
        async with asyncio.timeout(30), httpx.AsyncClient(verify=_trusting(), trust_env=False) as http:
            while True:
                try:
                    await http.get(f"https://localhost:{https}/healthz")
                    break
                except httpx.TransportError:
                    await asyncio.sleep(0.05)
        yield https
    finally:
        process.terminate()
        await process.wait()


async def _stops_get_through(rig: Rig, url: str, token: dict[str, str]) -> None:
    """Each on a connection of its own, as somebody who has just come."""
    for _ in range(STOPS):
        async with httpx.AsyncClient(verify=_trusting(), trust_env=False, timeout=PATIENCE) as http:
            answer = await http.post(f"{url}/api/stop", headers=token, json={"reason": "a person"})
        assert answer.status_code == 200, answer.text
    assert len(rig.app.state.connection_places) <= PLACES
    assert rig.dependencies.console.peers.places.taken == 0


@pytest.mark.parametrize("kind", FLOODS)
@pytest.mark.parametrize("encrypted", [False, True], ids=["plain", "tls"])
async def test_a_stop_is_answered_in_every_flood(kind: str, encrypted: bool, tmp_path: Path) -> None:
    certificate = None
    if encrypted:
        certificate = self_signed(tmp_path, {"localhost", "127.0.0.1"}, datetime.datetime.now(datetime.UTC))
    async with _console(certificate) as rig:
        tls = _trusting() if encrypted else None
        async with _flood(int(rig.url.rpartition(":")[2]), FLOODS[kind], tls) as begun:
            await _stops_get_through(rig, rig.url, rig.token("observer"))
            assert len(begun) >= HELD
        assert not [each for family in rig.dependencies.metrics.internal_errors.collect() for each in family.samples]
        await eventually(lambda: len(rig.app.state.connection_places) <= 1)


@pytest.mark.browser
@pytest.mark.skipif(shutil.which("caddy") is None, reason="needs caddy")
@pytest.mark.parametrize("kind", ["slow post", "stop without a token", "silent", "not found"])
async def test_a_stop_is_answered_behind_caddy_in_a_flood_through_it(kind: str, tmp_path: Path) -> None:
    async with AsyncExitStack() as stack:
        rig = await stack.enter_async_context(_console())
        port = await stack.enter_async_context(_caddy(rig, tmp_path))
        async with _flood(port, FLOODS[kind], _trusting()):
            await _stops_get_through(rig, f"https://localhost:{port}", rig.token("observer"))
