"""Runs the process that plays on the loudspeaker, and follows its state."""

import asyncio
import sys
import time
from collections.abc import Callable
from contextlib import suppress

import msgspec
import structlog

from lockstep.server.media.sources.source_wire import Said, Trouble
from lockstep.server.talkback.player import VOICE, VoicePacket
from lockstep.server.talkback.speaker_url import SpeakerSpec
from lockstep.server.util.backoff import Backoff
from lockstep.server.util.framed_pipe import FramedPipe

__all__ = ["Speaker"]

log = structlog.get_logger(__name__)

COMMAND = (sys.executable, "-m", "lockstep.server.talkback.player")
HEALTHY = 10.0  # s
MAX_WORDS = 4096  # bytes
WORDS: FramedPipe[Said] = FramedPipe(Said, MAX_WORDS)


class Speaker:
    """Await `run`; call `play` at any time. Packets that the process does not take at once are left out."""

    def __init__(self, spec: SpeakerSpec, changed: Callable[[], None], command: tuple[str, ...] = COMMAND) -> None:
        """`changed` is called on the loop when `trouble` changed."""
        self.trouble = ""  # reason that nothing is heard, in words
        self.dropped = 0  # packets that the process did not take
        self.failures = 0
        self._spec = spec
        self._changed = changed
        self._command = command
        self._writer: asyncio.StreamWriter | None = None

    def play(self, packet: bytes) -> bool:
        """Hand on an Opus packet that just came. Return whether the process took it."""
        writer = self._writer
        if writer is None or writer.transport.is_closing() or writer.transport.get_write_buffer_size() > 0:
            self.dropped += 1
            return False
        writer.write(VOICE.encode(VoicePacket(packet, time.monotonic())))
        return True

    async def run(self) -> None:
        """Run until cancelled. Restart a process that dies."""
        backoff = Backoff(0.5, 10.0)
        loop = asyncio.get_running_loop()
        while True:
            began = loop.time()
            await self._run_process()
            self._enter("the source's process ended")
            if loop.time() - began > HEALTHY:
                backoff.healthy()
            await asyncio.sleep(backoff.next())

    async def _run_process(self) -> None:
        process = await asyncio.create_subprocess_exec(
            *self._command,
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.DEVNULL,
            limit=MAX_WORDS,
        )
        try:
            if process.stdin is None or process.stdout is None:
                raise RuntimeError("the process has no pipes")
            process.stdin.write(msgspec.json.encode(self._spec) + b"\n")
            self._writer = process.stdin
            await self._hear(process.stdout)
        finally:
            self._writer = None
            with suppress(ProcessLookupError):
                process.kill()
            await process.wait()

    async def _hear(self, output: asyncio.StreamReader) -> None:
        while (said := await WORDS.receive(output)) is not None:
            self._enter(said.detail if isinstance(said, Trouble) else "")

    def _enter(self, trouble: str) -> None:
        if trouble == self.trouble:
            return
        self.trouble = trouble
        if trouble:
            self.failures += 1
            log.warning("speaker failed", detail=trouble)
        else:
            log.info("speaker works", kind=self._spec.scheme)
        self._changed()
