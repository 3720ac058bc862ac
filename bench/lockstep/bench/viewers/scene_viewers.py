"""Viewers of the 3D scene in a separate process, which read everything and draw nothing.

`python -m lockstep.bench.viewers.scene_viewers LINK COUNT` prints a JSON line once all viewers receive something, then
answers each line on standard input with the number of bytes that they have received. It ends at the end of its input.
The process runs at a low priority, because a viewer's own computer would not be the operator's.
"""

import asyncio
import os
import sys
from contextlib import AsyncExitStack
from urllib.parse import parse_qs, urlsplit

import httpx
import viser
from websockets.asyncio.client import ClientConnection, connect
from websockets.typing import Subprotocol

from lockstep.bench.harness.asked import answer, say
from lockstep.client.console_url import parse_link

__all__ = ["main"]

NICENESS = 10
VERSION = Subprotocol(f"viser-v{viser.__version__}")


class Viewer:
    """A WebSocket to the scene, through the console's proxy and its access check."""

    def __init__(self, websocket: ClientConnection) -> None:
        self.received = 0  # bytes
        self._websocket = websocket
        self.sees = asyncio.Event()

    async def watch(self) -> None:
        async for message in self._websocket:
            self.received += len(message)
            self.sees.set()


async def watch(link: str, count: int) -> None:
    async with AsyncExitStack() as stack, asyncio.TaskGroup() as tasks:
        viewers = [Viewer(await stack.enter_async_context(await _opened(link))) for _ in range(count)]
        watching = [tasks.create_task(viewer.watch()) for viewer in viewers]
        for viewer in viewers:
            await viewer.sees.wait()
        say({"viewers": count})
        await answer(lambda: {"received": [viewer.received for viewer in viewers]})
        for task in watching:
            task.cancel()


async def _opened(link: str) -> connect:
    """Ask for a ticket as the page does, and connect to the address in it."""
    console = parse_link(link)
    async with httpx.AsyncClient(trust_env=False) as http:
        answer = await http.post(f"{console.base}/api/scene", headers={"Authorization": f"Bearer {console.token}"})
    path: str = answer.raise_for_status().json()["path"]
    address = parse_qs(urlsplit(path).query)["websocket"][0]
    return connect(address, subprotocols=[VERSION], proxy=None, max_size=None, compression=None)


def main() -> None:
    os.nice(NICENESS)
    asyncio.run(watch(sys.argv[1], int(sys.argv[2])))


if __name__ == "__main__":
    main()
