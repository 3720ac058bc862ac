"""Opens a TCP connection as soon as a path is back.

The kernel repeats a lost SYN after 1, 3 and 7 s. A new connection beside it finds the path sooner.
"""

import asyncio
import socket
import time
from collections.abc import Awaitable, Callable
from typing import NamedTuple

__all__ = ["INTERVAL", "MOST", "TcpConnection", "connect_first"]

INTERVAL = 0.25  # s until the next connection is tried beside those that have no answer yet
MOST = 4  # at once. The first has time for the longest path; of the others the oldest gives way to a new one

Connect = Callable[[], Awaitable[socket.socket]]


class TcpConnection(NamedTuple):
    socket: socket.socket
    seconds: float  # that its own opening took: a round trip, unless its first packet was lost


async def connect_first(
    host: str, port: int, *, interval: float = INTERVAL, connect: Connect | None = None
) -> TcpConnection:
    """Return the first of several connections to `host` that is open. Wait for ever; the caller bounds the time.

    Args:
        connect: opens one connection; None: by name and TCP

    Raises:
        OSError: a connection was refused, or there is no way or no such host.
    """
    outcomes: asyncio.Queue[TcpConnection | OSError] = asyncio.Queue()

    async def open_one() -> None:
        began = time.monotonic()
        try:
            made = await (_connect(host, port) if connect is None else connect())
            outcomes.put_nowait(TcpConnection(made, time.monotonic() - began))
        except OSError as error:
            outcomes.put_nowait(error)

    try:
        async with asyncio.TaskGroup() as tasks:
            opening: list[asyncio.Task[None]] = []
            while outcomes.empty():
                if len(opening) == MOST:
                    opening.pop(1).cancel()
                opening.append(tasks.create_task(open_one()))
                await asyncio.wait(opening, timeout=interval, return_when=asyncio.FIRST_COMPLETED)
            for task in opening:
                task.cancel()
        first = outcomes.get_nowait()
    finally:
        while not outcomes.empty():  # others were open in the same moment, or nobody waits any more
            if isinstance(other := outcomes.get_nowait(), TcpConnection):
                other.socket.close()
    if isinstance(first, OSError):
        raise first
    return first


async def _connect(host: str, port: int) -> socket.socket:
    """Open a connection to the first of the host's addresses that takes it."""
    loop = asyncio.get_running_loop()
    error: OSError | None = None
    for family, kind, protocol, _, address in await loop.getaddrinfo(host, port, type=socket.SOCK_STREAM):
        made = socket.socket(family, kind, protocol)
        try:
            made.setblocking(False)
            await loop.sock_connect(made, address)
        except OSError as failed:
            made.close()
            error = failed
        except BaseException:
            made.close()
            raise
        else:
            return made
    raise error or OSError(f"no address of {host}")
