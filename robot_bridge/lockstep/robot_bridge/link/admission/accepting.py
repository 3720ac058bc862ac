"""Waits for connections, and loses none."""

import asyncio
import socket
from typing import Any

__all__ = ["accepted", "readable"]


async def accepted(listener: socket.socket) -> tuple[socket.socket, Any]:
    """Return the next connection and its address.

    `loop.sock_accept` loses a connection where its caller is cancelled in the turn in which it is accepted: the socket
    stays open, and its peer waits, until the garbage collector finds it. Here it is accepted when somebody has it.

    Args:
        listener: does not block

    Raises:
        OSError: the connection has gone, or the system has no descriptor left.
    """
    while True:
        try:
            return listener.accept()
        except BlockingIOError:
            await readable(listener)


async def readable(waited_for: socket.socket) -> None:
    """Wait until a socket can be read, or has a connection to accept."""
    loop = asyncio.get_running_loop()
    came = loop.create_future()

    def come() -> None:
        loop.remove_reader(waited_for)
        if not came.done():
            came.set_result(None)

    loop.add_reader(waited_for, come)
    try:
        await came
    finally:
        loop.remove_reader(waited_for)
