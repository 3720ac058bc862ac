"""The process with LiveKit's client, as the console sees it.

The client is native code with threads of its own: an error in it ends its process, and its callbacks wait for Python's
lock. In a process of its own it can neither end the console nor hold it up. What it is sent waits in a pipe and a
bounded buffer; what does not fit there stays in the outboxes of the streams, where the newest wins.
"""

import asyncio
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress

import msgspec

from server.relay.errors import RelayClientFailed, RelayError, RelayRefused, RelaySilent, RelayUnreachable
from server.relay.livekit_wire import (
    MAX_LENGTH,
    Ended,
    Feedback,
    Join,
    Joined,
    Order,
    Said,
    decode_said,
    encode_message,
)

__all__ = ["LiveKitProcess", "open_livekit"]

COMMAND = (sys.executable, "-m", "server.relay.livekit_worker")
JOIN_SECONDS = 15.0  # to start, connect and publish
CLOSE_SECONDS = 2.0
MOST_WAITING = 256 * 1024  # bytes in the buffer in front of the pipe
ERRORS: dict[str, type[RelayError]] = {"refused": RelayRefused, "unreachable": RelayUnreachable}


@asynccontextmanager
async def open_livekit(command: tuple[str, ...] = COMMAND) -> AsyncIterator["LiveKitProcess"]:
    """Running while entered. Raises RelayClientFailed when it cannot be started."""
    pipe = asyncio.subprocess.PIPE
    try:
        # Its error output could hold a token.
        process = await asyncio.create_subprocess_exec(
            *command, stdin=pipe, stdout=pipe, stderr=asyncio.subprocess.DEVNULL
        )
    except OSError as error:
        raise RelayClientFailed(f"cannot be started: {error.strerror}") from error
    try:
        yield LiveKitProcess(process)
    finally:
        await _end(process)


async def _end(process: asyncio.subprocess.Process) -> None:
    """The end of its input tells it to leave the room."""
    if process.stdin is not None:
        process.stdin.close()
    try:
        async with asyncio.timeout(CLOSE_SECONDS):
            await process.wait()
    except TimeoutError:
        with suppress(ProcessLookupError):
            process.kill()
        await process.wait()


class LiveKitProcess:
    """`join`, then `listen` as a task; the others at any time."""

    def __init__(self, process: asyncio.subprocess.Process) -> None:
        if process.stdin is None or process.stdout is None:
            raise RelayClientFailed("has no pipes")
        self._process = process
        self._input = process.stdin
        self._output = process.stdout
        self._waiting = ""  # feedback that did not fit; the newest
        self._draining: asyncio.Task[None] | None = None

    async def join(self, order: Join) -> None:
        """Returns when everything is published. Raises RelayError."""
        self._input.write(encode_message(order))
        try:
            async with asyncio.timeout(JOIN_SECONDS):
                while not isinstance(said := await self.hear(), Joined):
                    if isinstance(said, Ended):
                        raise ERRORS.get(said.reason, RelayClientFailed)(said.detail)
        except TimeoutError as error:
            raise RelaySilent(f"not in the room after {JOIN_SECONDS:g} s") from error

    async def hear(self) -> Said:
        """What it says next. Its end is `Ended`."""
        try:
            length = int.from_bytes(await self._output.readexactly(4), "big")
            if length > MAX_LENGTH:
                return Ended("failed", "its client makes no sense")
            return decode_said(await self._output.readexactly(length))
        except (asyncio.IncompleteReadError, ConnectionError):
            return Ended("failed", "its client's process ended")
        except msgspec.DecodeError:
            return Ended("failed", "its client makes no sense")

    def put(self, order: Order) -> bool:
        """False, and nothing is taken, while the process does not keep up."""
        transport = self._input.transport
        if transport.is_closing() or transport.get_write_buffer_size() > MOST_WAITING:
            return False
        self._input.write(encode_message(order))
        return True

    def put_newest(self, text: str) -> None:
        """Feedback: what does not fit waits, and a newer one takes its place."""
        if self._draining is None and self.put(Feedback(text)):
            return
        self._waiting = text
        if self._draining is None and not self._input.transport.is_closing():
            self._draining = asyncio.get_running_loop().create_task(self._drain())

    async def _drain(self) -> None:
        try:
            while text := self._waiting:
                self._waiting = ""
                with suppress(ConnectionError):
                    await self._input.drain()
                self.put(Feedback(text))
        finally:
            self._draining = None

    async def close(self) -> None:
        """What it does by itself ends."""
        if self._draining is not None:
            self._draining.cancel()
            await asyncio.gather(self._draining, return_exceptions=True)
