"""Connections that come and go without end, to any TCP server: `python -m … PORT floods COUNT`.

Each sends the preface of HTTP/2 and then what is no frame of it, or nothing, and is closed. The process prints a JSON
line when it begins, and ends at the end of its input.
"""

import asyncio
import os
import sys
from contextlib import suppress

from lockstep.bench.harness.asked import say

__all__ = ["main"]

PREFACE = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"  # RFC 9113 3.4
READ_SECONDS = 0.05


async def _flood(port: int) -> None:
    while True:
        with suppress(OSError, TimeoutError):
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            try:
                writer.write(PREFACE + os.urandom(1000))
                async with asyncio.timeout(READ_SECONDS):
                    await reader.read(100)
            finally:
                writer.close()  # also at the end: an open one would be closed by the collector, without a loop
        await asyncio.sleep(0)


async def _run(port: int, count: int) -> None:
    async with asyncio.TaskGroup() as tasks:
        running = [tasks.create_task(_flood(port)) for _ in range(count)]
        say({"connected": count})
        await asyncio.get_running_loop().run_in_executor(None, sys.stdin.read)
        for task in running:
            task.cancel()


def main() -> None:
    port, _, count = sys.argv[1:]
    asyncio.run(_run(int(port), int(count)))


if __name__ == "__main__":
    main()
