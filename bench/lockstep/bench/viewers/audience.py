"""Many observers in a separate process, which count RTP and decode nothing.

`python -m lockstep.bench.viewers.audience LINK COUNT [plain]` connects them, prints a JSON line, then answers each
line on standard input with each observer's counts so far. It ends at the end of its input. With `plain` the link is a
`lockstep.bench.baseline.baseline_server`.
"""

import asyncio
import signal
import sys
import time
from collections.abc import AsyncIterator, Callable
from contextlib import AsyncExitStack, asynccontextmanager

import uvloop

from lockstep.bench.harness.asked import answer, say
from lockstep.client import Console
from lockstep.client.console_url import parse_link
from lockstep.client.media.rtp_counter import RtpCounter
from lockstep.client.media.rtp_header import parse_rtp_header
from lockstep.client.transport.webrtc_transport import WebRtcTransport

__all__ = ["main"]

AT_ONCE = 4  # connecting at the same time
CONNECT_SECONDS = 60.0
Counts = dict[str, list[int]]  # per stream: frames, packets lost


async def attend(link: str, count: int, plain: bool) -> None:
    began = time.monotonic()
    attending = asyncio.current_task()
    if attending is not None:  # observers say goodbye, or the console would send to closed sockets for a while
        asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, attending.cancel)
    gate = asyncio.Semaphore(AT_ONCE)
    stacks = [AsyncExitStack() for _ in range(count)]

    async def join(stack: AsyncExitStack) -> Callable[[], Counts]:
        async with gate:
            return await stack.enter_async_context(_plain(link) if plain else _observer(link))

    try:
        readers = await asyncio.gather(*(join(stack) for stack in stacks))
        say({"observers": count, "seconds": round(time.monotonic() - began, 1)})
        await answer(lambda: {"counts": [reader() for reader in readers]})
    except asyncio.CancelledError:
        pass
    finally:
        await asyncio.gather(*(stack.aclose() for stack in stacks))


@asynccontextmanager
async def _observer(link: str) -> AsyncIterator[Callable[[], Counts]]:
    async with Console(link, decode=False, name="observer", connect_seconds=CONNECT_SECONDS) as console:
        yield lambda: {stream.stream: [stream.frames, stream.lost] for stream in console.stats().streams}


@asynccontextmanager
async def _plain(link: str) -> AsyncIterator[Callable[[], Counts]]:
    """Do the same on a server that knows nothing of Lockstep; open the data channels and leave them silent."""
    counter = RtpCounter(None, lambda _: None)
    peer = WebRtcTransport(
        parse_link(f"{link}/#token=none"),
        carrier="trailer",
        video=1,
        audio=False,
        codec="VP8",
        route=None,
        tls_ca=None,
        relay_only=False,
        on_message=lambda _: None,
    )

    def count(data: bytes) -> None:
        header = parse_rtp_header(data)
        if header is not None:
            counter.take(header)

    try:
        await peer.negotiate()
        assert peer.packets is not None  # a peer that is negotiated has them
        peer.packets.plain(count, lambda _: None)
        await peer.connect(CONNECT_SECONDS)
        yield lambda: {"video": [counter.frames, counter.lost]}
    finally:
        await peer.close()


def main() -> None:
    uvloop.run(attend(sys.argv[1], int(sys.argv[2]), "plain" in sys.argv[3:]))


if __name__ == "__main__":
    main()
