"""Delays a stream of chunks by a path: reads on at once, and hands on each chunk when it has arrived."""

import asyncio
import time
from collections.abc import AsyncGenerator, AsyncIterable
from typing import TypeVar

from lockstep.emulator.transport.stream_path import StreamPath
from lockstep.server.util.background_tasks import background_tasks

__all__ = ["delayed", "sleep_until"]

Chunk = TypeVar("Chunk", bytes, bytes | str)
UNDER_WAY = 64  # chunks; then the source waits, as for a full window


async def sleep_until(when: float) -> None:
    """Sleep until a time of `time.monotonic`."""
    await asyncio.sleep(max(0.0, when - time.monotonic()))


async def delayed(source: AsyncIterable[Chunk], path: StreamPath) -> AsyncGenerator[Chunk]:
    """Yield the chunks of `source` later. Close it: it has a task that reads ahead."""
    queue: asyncio.Queue[tuple[float, Chunk | Exception | None]] = asyncio.Queue(UNDER_WAY)

    async def read() -> None:
        try:
            async for chunk in source:
                await queue.put((path.admit(time.monotonic(), len(chunk)), chunk))
        except Exception as error:
            await queue.put((0.0, error))
        else:
            await queue.put((0.0, None))

    async with background_tasks(read()):
        while True:
            when, chunk = await queue.get()
            if chunk is None:
                return
            if isinstance(chunk, Exception):
                raise chunk
            await sleep_until(when)
            yield chunk
