"""The output of a process, read as it comes."""

import asyncio
import json
from collections import deque
from typing import Any

__all__ = ["ProcessOutput"]

KEPT_LINES = 400


class ProcessOutput:
    """What a process has written, as far as it is kept. `read` it.

    Attributes:
        lines: the last lines
        errors: those of them on standard error
        unread: those of them on standard output that nobody has taken
        grew: set when a line comes, and at the end
        ended: True when standard output has ended
        complete: set when both streams have ended
    """

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.errors = deque[str](maxlen=KEPT_LINES)
        self.unread = deque[str](maxlen=KEPT_LINES)
        self.grew = asyncio.Event()
        self.ended = False
        self.complete = asyncio.Event()

    def said(self) -> list[dict[str, Any]]:
        """Return the lines that are JSON."""
        return [json.loads(line) for line in self.lines if line.startswith("{")]

    async def read(self, process: asyncio.subprocess.Process) -> None:
        """Read until both streams end."""
        async with asyncio.TaskGroup() as streams:
            streams.create_task(self._read(process.stderr, self.errors))
            await self._read(process.stdout, self.unread)
            self.ended = True
            self.grew.set()
        self.complete.set()

    async def _read(self, stream: asyncio.StreamReader | None, kept: deque[str]) -> None:
        if stream is not None:
            async for line in stream:
                text = line.decode(errors="replace").rstrip()
                kept.append(text)
                self._keep(text)

    def _keep(self, line: str) -> None:
        self.lines.append(line)
        del self.lines[:-KEPT_LINES]
        self.grew.set()
