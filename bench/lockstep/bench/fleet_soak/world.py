"""Runs a console with several simulated robots, each bridge a process that can be killed and started again."""

import asyncio
from collections.abc import Sequence
from contextlib import AsyncExitStack
from pathlib import Path
from types import TracebackType
from typing import Self

from lockstep.bench.harness.event_log import Record, records
from lockstep.bench.harness.lives import BridgeLives
from lockstep.bench.harness.processes import Running
from lockstep.bench.harness.stack import running_console

__all__ = ["FleetWorld"]


class _SpareBridge(BridgeLives):
    """A bridge that uses little of the machine."""

    def __init__(self, folder: Path, name: str, picture_rate: float) -> None:
        super().__init__(folder, name)
        self._picture_rate = picture_rate

    def command(self) -> Sequence[str]:
        arguments = (str(self.port), str(self.event_log), str(self._picture_rate))
        return ("lockstep.bench.fleet_soak.spare_planar", *arguments)


class FleetWorld:
    """A context manager in which bridges and console run.

    Attributes:
        operator: link to the overview; `link` returns that of one robot
        console: the console's process
    """

    def __init__(self, folder: Path, robots: int, picture_rate: float | None) -> None:
        """`picture_rate`: Hz, of one camera; 0: none; None: both cameras and the microphone as they are."""
        self.names = [f"robot-{number}" for number in range(1, robots + 1)]
        self.operator = ""
        self._folder = folder
        self._bridges = {
            name: BridgeLives(folder, name) if picture_rate is None else _SpareBridge(folder, name, picture_rate)
            for name in self.names
        }
        self._stack = AsyncExitStack()
        self._console: Running | None = None

    async def __aenter__(self) -> Self:
        try:
            await self._start()
        except BaseException:
            await self._stack.aclose()
            raise
        return self

    async def _start(self) -> None:
        for bridge in self._bridges.values():
            self._stack.push_async_callback(bridge.end)
        async with asyncio.TaskGroup() as tasks:
            for bridge in self._bridges.values():
                tasks.create_task(bridge.begin())
        robots = [f"{name}={bridge.address}" for name, bridge in self._bridges.items()]
        settings = {"LOCKSTEP_STATE_DIR": str(self._folder / "state")}
        self._console, links = await self._stack.enter_async_context(running_console(*robots, environment=settings))
        self.operator = links["operator"]

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        await self._stack.aclose()

    @property
    def console(self) -> Running:
        if self._console is None:
            raise RuntimeError("the console does not run")
        return self._console

    def link(self, name: str) -> str:
        """Return the operator's link to that robot."""
        base, _, fragment = self.operator.partition("/#")
        return f"{base}/robots/{name}/#{fragment}"

    async def kill(self, name: str) -> None:
        """Kill a bridge as a crash does, and start it again a moment later, with a new epoch."""
        await self._bridges[name].kill()
        await self._bridges[name].begin()

    def records(self, name: str) -> list[Record]:
        """Return that bridge's own record of all its lives."""
        return list(records(self._bridges[name].event_log))
