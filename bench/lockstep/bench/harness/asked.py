"""The process that `Running.ask` asks: it says JSON lines, and answers each line on its standard input."""

import asyncio
import json
import sys
from collections.abc import Callable

__all__ = ["answer", "say"]


def say(message: object) -> None:
    print(json.dumps(message), flush=True)


async def answer(reply: Callable[[], object]) -> None:
    """Say `reply()` for each line on standard input, until that ends."""
    lines = asyncio.StreamReader()
    await asyncio.get_running_loop().connect_read_pipe(lambda: asyncio.StreamReaderProtocol(lines), sys.stdin)
    async for _ in lines:
        say(reply())
