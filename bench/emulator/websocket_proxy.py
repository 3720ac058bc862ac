"""Joins a browser's WebSocket with the console's, each direction over its path. It carries the 3D scene."""

import asyncio
from collections.abc import AsyncIterator, Mapping
from contextlib import aclosing, suppress

from starlette.websockets import WebSocket, WebSocketDisconnect
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidHandshake
from websockets.typing import Subprotocol

from bench.emulator.delayed import delayed
from bench.emulator.profile import Direction
from bench.emulator.stream_path import StreamPath

__all__ = ["join"]

MAX_MESSAGE = 64 << 20  # bytes
POLICY_VIOLATION = 1008  # RFC 6455 7.4.1
GOING_AWAY = 1001


async def join(browser: WebSocket, url: str, paths: Mapping[Direction, StreamPath]) -> None:
    """Until one side closes. `url` is the console's side."""
    headers = {name: browser.headers[name] for name in ("origin", "host") if name in browser.headers}
    wanted = [Subprotocol(each) for each in browser.scope.get("subprotocols", [])]
    try:
        upstream = await connect(
            url,
            subprotocols=wanted or None,
            additional_headers=headers,
            origin=None,
            compression=None,
            max_size=MAX_MESSAGE,
            proxy=None,
        )
    except (OSError, TimeoutError, InvalidHandshake, ConnectionClosed):
        await browser.close(POLICY_VIOLATION)
        return
    async with upstream:
        await browser.accept(subprotocol=upstream.subprotocol)
        loop = asyncio.get_running_loop()
        ways = (
            loop.create_task(_to_console(browser, upstream, paths["to_robot"])),
            loop.create_task(_to_browser(upstream, browser, paths["to_operator"])),
        )
        try:
            await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for way in ways:
                way.cancel()
            await asyncio.gather(*ways, return_exceptions=True)


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
