"""One attached source as the console sees it: its process, the thread that hears it, and how it does."""

import asyncio
import os
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import BinaryIO

import msgspec
import structlog

from server.backoff import Backoff
from server.media.sources.mailbox import Mailbox
from server.media.sources.source_url import SourceSpec
from server.media.sources.source_wire import Captured, SourceState, Trouble, read_said

__all__ = ["AttachedSource"]

log = structlog.get_logger(__name__)

PATIENCE = 30.0  # s without a word: a device hangs
COMMAND = (sys.executable, "-m", "server.media.sources.reader")


class AttachedSource:
    """Await `run`; it ends when it is cancelled, with its process and thread.

    Attributes:
        state, detail: how it does, in words without its address
        failures: by reason, since the start
    """

    def __init__(
        self,
        spec: SourceSpec,
        captured: Callable[[Captured], None],
        changed: Callable[[], None],
        failed: Callable[[str], None],
        command: tuple[str, ...] = COMMAND,
    ) -> None:
        """`captured`, `changed` and `failed` are called on the loop; the last with a stable reason."""
        self.spec = spec
        self.state: SourceState = "connecting"
        self.detail = ""
        self._captured = captured
        self._changed = changed
        self._failed = failed
        self._command = command
        self._box = Mailbox()
        self._heard_at = 0.0
        self._ended = asyncio.Event()  # the process closed its output

    @property
    def dropped(self) -> int:
        """Media that came faster than the loop took them."""
        return self._box.dropped

    async def run(self) -> None:
        """Until cancelled. A process that dies is started again, and again more rarely."""
        backoff = Backoff(0.5, 10.0)
        loop = asyncio.get_running_loop()
        while True:
            began = loop.time()
            why = await self._run_process()
            self._trouble(Trouble(why, "its process ended" if why == "died" else "it hangs"))
            if loop.time() - began > PATIENCE:
                backoff.healthy()
            await asyncio.sleep(backoff.next())

    async def _run_process(self) -> str:
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
        thread = threading.Thread(target=self._hear, args=(output, loop), name=f"source-{self.spec.name}", daemon=True)
        thread.start()
        try:
            if process.stdin is not None:
                process.stdin.write(msgspec.json.encode(self.spec) + b"\n")
            return await self._until_ended(loop)
        finally:
            with suppress(ProcessLookupError):
                process.kill()
            await process.wait()
            thread.join()  # at once: its pipe has no other end any more

    async def _until_ended(self, loop: asyncio.AbstractEventLoop) -> str:
        while True:
            try:
                async with asyncio.timeout_at(self._heard_at + PATIENCE):
                    await self._ended.wait()
                    return "died"
            except TimeoutError:
                if loop.time() - self._heard_at >= PATIENCE:
                    return "hung"

    def _hear(self, output: BinaryIO, loop: asyncio.AbstractEventLoop) -> None:
        """In the thread."""
        with output, suppress(RuntimeError):  # the loop has closed
            while (said := read_said(output)) is not None:
                if self._box.put(said):
                    loop.call_soon_threadsafe(self._take)
            loop.call_soon_threadsafe(self._ended.set)

    def _take(self) -> None:
        self._heard_at = asyncio.get_running_loop().time()
        for said in self._box.take():
            if isinstance(said, Captured):
                self._captured(said)
            elif isinstance(said, Trouble):
                self._trouble(said)
            else:
                log.info("source live", source=self.spec.name, gives=said.detail)
                self._enter("live", said.detail)

    def _trouble(self, trouble: Trouble) -> None:
        self._failed(trouble.reason)
        if (self.state, self.detail) != ("reconnecting", trouble.detail):
            log.warning("source failed", source=self.spec.name, reason=trouble.reason, detail=trouble.detail)
        self._enter("reconnecting", trouble.detail)

    def _enter(self, state: SourceState, detail: str) -> None:
        if (state, detail) != (self.state, self.detail):
            self.state, self.detail = state, detail
            self._changed()
