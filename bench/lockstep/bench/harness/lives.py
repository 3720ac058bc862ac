"""Processes that are killed and started again at the same address, as after a crash."""

import asyncio
import sys
from collections.abc import Sequence
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any

from lockstep.bench.harness.processes import Running, running_process

__all__ = ["DOWN_SECONDS", "BridgeLives", "Lives"]

DOWN_SECONDS = 1.0  # between a death and the next life


class Lives:
    """The lives of one process, of which at most one is running."""

    def __init__(self) -> None:
        self.running: Running | None = None  # the newest life, which may have ended
        self._stack = AsyncExitStack()

    async def begin(self, *command: str, **environment: str) -> dict[str, Any]:
        """Start it; return the line with which it reports that it is ready. Raises ProcessFailed."""
        stack = AsyncExitStack()
        self.running, ready = await stack.enter_async_context(running_process(*command, environment=environment))
        self._stack = stack
        return ready

    async def kill(self) -> None:
        """Kill it, as a crash does, and wait for the time in which it is down."""
        if self.running is not None:
            await self.running.kill()
        await self.end()
        await asyncio.sleep(DOWN_SECONDS)

    async def end(self) -> None:
        await self._stack.aclose()


class BridgeLives:
    """A bridge of the planar robot that keeps its port and its event log over its lives.

    Each life has a state directory of its own, because a bridge that was killed begins stopped.
    """

    def __init__(self, folder: Path, name: str = "events") -> None:
        self.event_log = folder / f"{name}.jsonl"
        self.port = 0
        self._state = folder / f"{name}-state"
        self._count = 0
        self._lives = Lives()

    @property
    def address(self) -> str:
        return f"tcp://127.0.0.1:{self.port}"

    def command(self) -> Sequence[str]:
        """Return the arguments of `python -m` for a life."""
        files = ("--event-log", str(self.event_log), "--state-dir", f"{self._state}-{self._count}")
        return ("lockstep.robot_bridge", "planar", "--port", str(self.port), "--json", *files)

    async def begin(self, **environment: str) -> None:
        """Raises ProcessFailed."""
        self._count += 1
        ready = await self._lives.begin(sys.executable, "-m", *self.command(), **environment)
        self.port = int(ready["robot"].rsplit(":", 1)[1])

    async def kill(self) -> None:
        await self._lives.kill()

    async def end(self) -> None:
        await self._lives.end()
