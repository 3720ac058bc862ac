"""Viewers of the Foxglove server in a separate process: some read everything, some read nothing, some flood it.

`python -m lockstep.bench.viewers.foxglove_crowd PORT KIND COUNT` prints a JSON line once all are connected, and ends at
the end of its input. KIND: "reads", "reads_nothing" or "floods", which subscribes and unsubscribes without end.
"""

import asyncio
import json
import sys
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from typing import Any

from websockets.asyncio.client import ClientConnection, connect
from websockets.typing import Subprotocol

from lockstep.bench.harness.asked import say

__all__ = ["main"]

SUBPROTOCOL = Subprotocol("foxglove.sdk.v1")
CONNECT_SECONDS = 60.0
AT_ONCE = 200  # subscriptions that a flood sends before it takes them back


@asynccontextmanager
async def _viewer(port: int) -> AsyncIterator[tuple[ClientConnection, list[int]]]:
    """Yield a connection, and the channels that it was offered."""
    async with connect(f"ws://127.0.0.1:{port}", subprotocols=[SUBPROTOCOL], max_size=None) as socket:
        channels: list[int] = []
        while not channels:
            frame = await socket.recv()
            message: dict[str, Any] = json.loads(frame) if isinstance(frame, str) else {}
            channels = [each["id"] for each in message.get("channels", ())]
        yield socket, channels


def _subscribe(channels: list[int]) -> str:
    wanted = [{"id": number, "channelId": channel} for number, channel in enumerate(channels, start=1)]
    return json.dumps({"op": "subscribe", "subscriptions": wanted})


async def _read(socket: ClientConnection, channels: list[int]) -> None:
    await socket.send(_subscribe(channels))
    async for _ in socket:
        pass


async def _read_nothing(socket: ClientConnection, channels: list[int]) -> None:
    await socket.send(_subscribe(channels))
    socket.transport.pause_reading()
    await asyncio.Event().wait()


async def _flood(socket: ClientConnection, channels: list[int]) -> None:
    on = _subscribe(channels)
    off = json.dumps({"op": "unsubscribe", "subscriptionIds": list(range(1, len(channels) + 1))})
    async with asyncio.TaskGroup() as tasks:
        tasks.create_task(_drain(socket))
        while True:
            for _ in range(AT_ONCE):
                await socket.send(on)
                await socket.send(off)


async def _drain(socket: ClientConnection) -> None:
    async for _ in socket:
        pass


KINDS = {"reads": _read, "reads_nothing": _read_nothing, "floods": _flood}


async def _run(port: int, kind: str, count: int) -> None:
    loop = asyncio.get_running_loop()
    async with AsyncExitStack() as stack, asyncio.TaskGroup() as tasks:
        async with asyncio.timeout(CONNECT_SECONDS):
            viewers = [await stack.enter_async_context(_viewer(port)) for _ in range(count)]
        running = [tasks.create_task(KINDS[kind](socket, channels)) for socket, channels in viewers]
        say({"connected": count})
        await loop.run_in_executor(None, sys.stdin.read)
        for task in running:
            task.cancel()


def main() -> None:
    port, kind, count = sys.argv[1:]
    asyncio.run(_run(int(port), kind, int(count)))


if __name__ == "__main__":
    main()
