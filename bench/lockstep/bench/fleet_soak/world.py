"""Runs a console with several simulated robots, each bridge a process that can be killed and started again."""

import asyncio
import sys
from contextlib import AsyncExitStack
from pathlib import Path
from types import TracebackType
from typing import Self

from lockstep.bench.fleet_soak.records import Record, read_records
from lockstep.bench.harness.processes import Running, running_process

__all__ = ["DOWN_SECONDS", "FleetWorld"]

DOWN_SECONDS = 1.0  # between a bridge's death and its next life


class _Bridge:
    """A bridge that keeps its port over its lives, so that the console finds it again."""

    def __init__(self, name: str, folder: Path, picture_rate: float | None) -> None:
        self.name = name
        self.event_log = folder / f"{name}.jsonl"
        self.port = 0
        self._folder = folder
        self._lives = 0
        self._picture_rate = picture_rate
        self._life = AsyncExitStack()
        self._process: Running | None = None

    async def start(self) -> None:
        port, log = str(self.port), str(self.event_log)
        self._lives += (
            1  # a new state directory for each: one that was killed begins stopped, which is not at issue here
        )
        state = str(self._folder / f"{self.name}-state-{self._lives}")
        command = [
            "lockstep.robot_bridge",
            "planar",
            "--port",
            port,
            "--event-log",
            log,
            "--state-dir",
            state,
            "--json",
        ]
        if self._picture_rate is not None:
            command = ["lockstep.bench.fleet_soak.spare_planar", port, log, str(self._picture_rate)]
        life = AsyncExitStack()
        self._process, ready = await life.enter_async_context(running_process(sys.executable, "-m", *command))
        self._life = life
        self.port = int(ready["robot"].rsplit(":", 1)[1])

    async def kill(self) -> None:
        if self._process is not None:
            await self._process.kill()
        await self._life.aclose()

    async def close(self) -> None:
        await self._life.aclose()


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
        self._bridges = {name: _Bridge(name, folder, picture_rate) for name in self.names}
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
            self._stack.push_async_callback(bridge.close)
        async with asyncio.TaskGroup() as tasks:
            for bridge in self._bridges.values():
                tasks.create_task(bridge.start())
        robots = [f"--robot={each.name}=tcp://127.0.0.1:{each.port}" for each in self._bridges.values()]
        lockstep = str(Path(sys.executable).with_name("lockstep"))
        self._console, links = await self._stack.enter_async_context(
            running_process(
                *(lockstep, "serve", *robots, "--port", "0", "--json", "--quiet"),
                environment={"LOCKSTEP_STATE_DIR": str(self._folder / "state")},
            )
        )
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
        await asyncio.sleep(DOWN_SECONDS)
        await self._bridges[name].start()

    def records(self, name: str) -> list[Record]:
        """Return that bridge's own record of all its lives."""
        return read_records(self._bridges[name].event_log)
