"""Many observers behind relays: `python -m lockstep.bench.relay.audience LINK COUNT`.

Each is a complete observer: a line to the console, and the main camera with the feedback from a relay. RTP is counted
as it comes out of the socket, neither decrypted nor decoded, so that so many fit on the machine they load. Once all are
connected a JSON line is printed, and every second afterwards one with the packets that each has got by then and the
number of lost connections by reason.
"""

import asyncio
import json
import sys
import time
from collections import Counter
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from typing import Any

import uvloop

from lockstep.client import Console, ConsoleError
from lockstep.rtc.addresses import Path
from lockstep.rtc.demux import DatagramKind, datagram_kind

__all__ = ["main"]

AT_ONCE = 4  # connecting at the same time
CONNECT_SECONDS = 60.0
TRIES = 5


class _Counter:
    """Takes each datagram before an observer's connection to the relay, and counts RTP."""

    def __init__(self, peer: Any) -> None:
        self.packets = 0
        self._pass_on = peer.receive_datagram
        peer.receive_datagram = self.take

    def take(self, data: bytes, path: Path, now: float) -> None:
        if datagram_kind(data) is DatagramKind.RTP:
            self.packets += 1
        else:
            self._pass_on(data, path, now)


@asynccontextmanager
async def _connected(link: str, name: str) -> AsyncIterator[Console]:
    """Connect; try again while the machine is too busy to answer."""
    async with AsyncExitStack() as stack:
        for left in reversed(range(TRIES)):
            console = Console(
                link,
                through_relay=True,
                decode=False,
                video=1,
                audio=False,
                name=name,
                connect_seconds=CONNECT_SECONDS,
                silence_seconds=60.0,
            )
            try:
                await stack.enter_async_context(console)
                break
            except ConsoleError:
                if not left:
                    raise
        yield console


async def watch(link: str, count: int) -> None:
    began = time.monotonic()
    async with AsyncExitStack() as stack:
        gate = asyncio.Semaphore(AT_ONCE)
        consoles: list[Console] = []
        counters: list[_Counter] = []

        async def connect(number: int) -> None:
            async with gate:
                console = await stack.enter_async_context(_connected(link, f"watcher {number}"))
            consoles.append(console)
            relay: Any = console._live().relay
            counters.append(_Counter(relay.connection.peer))

        async with asyncio.TaskGroup() as tasks:
            for number in range(count):
                tasks.create_task(connect(number))
        relays = sorted({console.relay for console in consoles})
        by_relay = {relay: sum(console.relay == relay for console in consoles) for relay in relays}
        print(json.dumps({"connected": time.monotonic() - began, "relays": by_relay}), flush=True)
        while True:
            await asyncio.sleep(1.0)
            counts = [counter.packets for counter in counters]
            lost = Counter(str(lost) for console in consoles if (lost := console._live().lost) is not None)
            print(json.dumps({"at": time.monotonic(), "packets": counts, "lost": lost}), flush=True)


def main() -> None:
    uvloop.run(watch(sys.argv[1], int(sys.argv[2])))


if __name__ == "__main__":
    main()
