"""The process that reads one source, and the thread that reads its messages."""

import asyncio
import os
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import BinaryIO

from lockstep.server.media.sources.latest_value import LatestValue
from lockstep.server.media.sources.source_wire import SAID, Said

__all__ = ["ReaderProcess"]

MOST_UNREAD = 4_000_000  # bytes that wait until the process reads them


class ReaderProcess:
    """Runs the process of a source. Await `run`, again when it has ended; it ends with its process and thread."""

    def __init__(
        self,
        name: str,
        command: tuple[str, ...],
        said: Callable[[Said], None],
        patience: Callable[[], float] | None,
    ) -> None:
        """`said` is called on the loop. `patience`: s without a message until it counts as hung; None: no limit."""
        self._name = name
        self._command = command
        self._said = said
        self._patience = patience
        self._box = LatestValue()
        self._heard_at = 0.0
        self._ended = asyncio.Event()  # the process closed its output
        self._input: asyncio.StreamWriter | None = None  # None: it does not run

    @property
    def dropped(self) -> int:
        """Media that came faster than the loop took them."""
        return self._box.dropped

    def write(self, data: bytes) -> bool:
        """Write to the process. False, and nothing written, if it does not run or does not keep up."""
        if self._input is None or self._input.transport.get_write_buffer_size() + len(data) > MOST_UNREAD:
            return False
        self._input.write(data)
        return True

    async def run(self, first: bytes) -> str:
        """Start the process with `first` as its first input. Return why it ended: "died" or "hung"."""
        loop = asyncio.get_running_loop()
        reading, writing = os.pipe()
        output = os.fdopen(reading, "rb", buffering=1 << 20)
        try:
            # Its error output could hold the address.
            process = await asyncio.create_subprocess_exec(
                *self._command, stdin=asyncio.subprocess.PIPE, stdout=writing, stderr=asyncio.subprocess.DEVNULL
            )
        except BaseException:
            output.close()
            raise
        finally:
            os.close(writing)
        self._ended.clear()
        self._heard_at = loop.time()
        thread = threading.Thread(target=self._hear, args=(output, loop), name=f"source-{self._name}", daemon=True)
        thread.start()
        try:
            self._input = process.stdin
            self.write(first)
            return await self._until_ended(loop)
        finally:
            self._input = None
            with suppress(ProcessLookupError):
                process.kill()
            await process.wait()
            thread.join()  # at once: its pipe has no other end any more

    async def _until_ended(self, loop: asyncio.AbstractEventLoop) -> str:
        while True:
            patience = None if self._patience is None else self._patience()
            try:
                async with asyncio.timeout_at(None if patience is None else self._heard_at + patience):
                    await self._ended.wait()
                    return "died"
            except TimeoutError:
                if patience is not None and loop.time() - self._heard_at >= patience:
                    return "hung"

    def _hear(self, output: BinaryIO, loop: asyncio.AbstractEventLoop) -> None:
        """Read messages, in the thread."""
        with output, suppress(RuntimeError):  # the loop has closed
            while (said := SAID.read(output)) is not None:
                if self._box.put(said):
                    loop.call_soon_threadsafe(self._take)
            loop.call_soon_threadsafe(self._ended.set)

    def _take(self) -> None:
        self._heard_at = asyncio.get_running_loop().time()
        for said in self._box.take():
            self._said(said)
