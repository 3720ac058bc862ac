"""The process with LiveKit's client: joins a room as a publisher, and sends there what it reads.

`python -m server.relay.livekit_worker`; orders come over standard input, whose end means that the console has gone or
wants no more of it. See `livekit_process` for why it is a process.
"""

import asyncio
import os
import sys
import threading
from contextlib import suppress
from typing import BinaryIO

import msgspec

from server.relay.livekit_room import LiveKitRoom
from server.relay.livekit_wire import Join, Said, decode_order, encode_message, read_message

__all__ = ["main"]

LEAVE_SECONDS = 1.0


async def work(orders: BinaryIO, out: BinaryIO) -> None:
    """Until there are no more orders, or the room ended."""

    def say(said: Said) -> None:
        with suppress(OSError):  # the console has gone; the end of the orders says so too
            out.write(encode_message(said))
            out.flush()

    room = LiveKitRoom(say)
    loop = asyncio.get_running_loop()

    def read() -> None:
        """In a thread."""
        try:
            while (data := read_message(orders)) is not None:
                order = decode_order(data)
                loop.call_soon_threadsafe(room.take, order)
        except msgspec.DecodeError:
            pass
        loop.call_soon_threadsafe(room.end)

    join = await loop.run_in_executor(None, read_message, orders)
    if join is None or not isinstance(order := decode_order(join), Join):
        return
    threading.Thread(target=read, daemon=True).start()
    if (ended := await room.run(order)) is not None:
        say(ended)
    with suppress(TimeoutError):
        async with asyncio.timeout(LEAVE_SECONDS):
            await room.leave()


def main() -> None:
    out = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what a library prints is no message
    with suppress(KeyboardInterrupt):
        asyncio.run(work(sys.stdin.buffer, out))
    os._exit(0)  # native threads that hang hold nobody up


if __name__ == "__main__":
    main()
