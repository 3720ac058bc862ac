"""Joins a browser's WebSocket with the console's, each direction over its path. It carries the 3D scene."""

import asyncio
import ssl
from collections.abc import AsyncIterator, Mapping
from contextlib import aclosing, suppress
from urllib.parse import urlsplit

from starlette.websockets import WebSocket, WebSocketDisconnect
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidHandshake
from websockets.typing import Origin, Subprotocol

from lockstep.emulator.impairment.profile import Direction
from lockstep.emulator.transport.delayed import delayed
from lockstep.emulator.transport.stream_path import StreamPath

__all__ = ["join"]

MAX_MESSAGE = 64 << 20  # bytes
POLICY_VIOLATION = 1008  # RFC 6455 7.4.1
GOING_AWAY = 1001
CLOSE_SECONDS = 1.0


async def join(browser: WebSocket, console: str, paths: Mapping[Direction, StreamPath]) -> None:
    """Forward messages until one side closes.

    `console`: the console's URL; the request to it names the host that the browser asked for.
    """
    target = urlsplit(console)
    secure = target.scheme == "https"
    query = f"?{browser.url.query}" if browser.url.query else ""
    origin = browser.headers.get("origin")
    try:
        upstream = await connect(
            f"{'wss' if secure else 'ws'}://{browser.headers['host']}{browser.url.path}{query}",
            host=target.hostname,
            port=target.port or (443 if secure else 80),
            ssl=_unchecked() if secure else None,
            origin=None if origin is None else Origin(origin),
            subprotocols=[Subprotocol(each) for each in browser.scope.get("subprotocols", [])] or None,
            compression=None,
            close_timeout=CLOSE_SECONDS,
            max_size=MAX_MESSAGE,
            proxy=None,
        )
    except (OSError, TimeoutError, InvalidHandshake, ConnectionClosed):
        await browser.close(POLICY_VIOLATION)
        return
    try:
        async with upstream:
            await browser.accept(subprotocol=upstream.subprotocol)
            async with asyncio.TaskGroup() as tasks:
                ways = (
                    tasks.create_task(_to_console(browser, upstream, paths["to_robot"])),
                    tasks.create_task(_to_browser(upstream, browser, paths["to_operator"])),
                )
                await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
                for way in ways:
                    way.cancel()
    finally:
        upstream.transport.abort()  # websockets leaves it open when its close is cancelled


def _unchecked() -> ssl.SSLContext:
    """Return a context without checks.

    The console's own certificate may be self-signed, and no other host is between it and this process.
    """
    context = ssl.create_default_context()
    context.check_hostname = False
    context.verify_mode = ssl.CERT_NONE
    return context


async def _to_console(browser: WebSocket, upstream: ClientConnection, path: StreamPath) -> None:
    with suppress(WebSocketDisconnect, ConnectionClosed):
        async with aclosing(delayed(_messages(browser), path)) as messages:
            async for message in messages:
                await upstream.send(message)


async def _to_browser(upstream: ClientConnection, browser: WebSocket, path: StreamPath) -> None:
    with suppress(WebSocketDisconnect, ConnectionClosed, RuntimeError):
        async with aclosing(delayed(upstream, path)) as messages:
            async for message in messages:
                if isinstance(message, str):
                    await browser.send_text(message)
                else:
                    await browser.send_bytes(message)
        await browser.close(GOING_AWAY)


async def _messages(browser: WebSocket) -> AsyncIterator[bytes | str]:
    while True:
        event = await browser.receive()
        if event["type"] == "websocket.disconnect":
            return
        yield event["bytes"] if event.get("bytes") is not None else event["text"]
