"""`lockstep up` as its user runs it: a process of its own on free ports, ended by its signal."""

import asyncio
import os
import signal
from collections.abc import AsyncIterator, Iterator, Mapping
from contextlib import asynccontextmanager, contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from lockstep.bench.harness.processes import READY_SECONDS, Running, running_process
from lockstep.bench.harness.stack import LOCKSTEP
from lockstep.server.fleet.simulated import own_event_log
from tests.support.event_logs import PATIENCE, written

__all__ = ["Stack", "running_console", "running_fleet", "running_stack"]

# Root's Chromium gives itself and its sound a higher priority than all others, which no robot's machine has to share.
FIRST = ("nice", "-n", "-12") if os.geteuid() == 0 else ()


@dataclass(kw_only=True)
class Stack:
    """A running console with its robot bridge; or of a fleet, whose robots are then named in every question.

    Attributes:
        console: "http://127.0.0.1:PORT"
        operator: the operator's link, token in the fragment
        observer: the observers' link
        supervisor: the supervisors' link
        robot: "tcp://127.0.0.1:PORT"; "" in a fleet
        robots: of a fleet, the same by name
        event_log: the bridge's own record, JSON lines
        skipped: how many of them were there before this test began
    """

    running: Running
    console: str
    operator: str
    observer: str
    supervisor: str
    robot: str = ""
    robots: dict[str, str] = field(default_factory=dict)
    event_log: Path
    skipped: int = 0

    @property
    def process(self) -> asyncio.subprocess.Process:
        return self.running.process

    @property
    def output(self) -> list[str]:
        """Its last lines on standard error."""
        return list(self.running.output.errors)

    def bridge_pid(self, robot: str = "") -> int:
        """The bridge's process: the child of `lockstep up` that writes this robot's log."""
        children = Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children").read_text().split()
        log = str(own_event_log(self.event_log, robot)).encode()
        found = [child for child in children if log in Path(f"/proc/{child}/cmdline").read_bytes().split(b"\0")]
        if len(found) != 1:
            raise RuntimeError(f"expected one bridge among the child processes {children}, found {found}")
        return int(found[0])

    @contextmanager
    def frozen_bridge(self, robot: str = "") -> Iterator[None]:
        """The bridge's process does not run inside the block."""
        with _frozen(self.bridge_pid(robot)):
            yield

    @contextmanager
    def frozen_console(self) -> Iterator[None]:
        """The console's process does not run inside the block."""
        with _frozen(self.process.pid):
            yield

    async def records(self, robot: str = "") -> list[dict[str, Any]]:
        """All that the bridge has recorded from the test's begin to this call; see `written`."""
        return (await self._written(robot))[self.skipped :]

    async def events(self, kind: str, robot: str = "") -> list[dict[str, Any]]:
        """Those of one kind."""
        return [record for record in await self.records(robot) if record["kind"] == kind]

    async def from_here(self) -> "Stack":
        """The same, without what the bridge has recorded until now."""
        return replace(self, skipped=len(await self._written("")))

    async def _written(self, robot: str) -> list[dict[str, Any]]:
        return await written(own_event_log(self.event_log, robot), lambda: self.process.returncode is not None)

    async def says(self, *words: str) -> None:
        """Until it has written a line with all these words on its standard error."""
        async with asyncio.timeout(PATIENCE):
            while not any(all(word in line for word in words) for line in self.output):  # noqa: ASYNC110
                await asyncio.sleep(0.01)


@contextmanager
def _frozen(pid: int) -> Iterator[None]:
    os.kill(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        with suppress(ProcessLookupError):  # it was killed meanwhile
            os.kill(pid, signal.SIGCONT)


@asynccontextmanager
async def running_stack(
    directory: Path,
    *,
    robot: str = "planar",
    port: int = 0,
    extra: tuple[str, ...] = (),
    settings: Mapping[str, str] | None = None,
    lockstep: Path | None = None,
    ready_seconds: float = READY_SECONDS,
) -> AsyncIterator[Stack]:
    """Start `lockstep up`, wait until it says that it is ready, and end it on leaving. `lockstep`: another one's."""
    event_log = directory / "events.jsonl"
    command: tuple[str, ...] = ("up", "--json", "--robot", robot, "--port", str(port), "--robot-port", "0")
    command = (*command, "--event-log", str(event_log), *extra)
    async with _running(directory, command, event_log, settings, lockstep, ready_seconds) as stack:
        yield stack


@asynccontextmanager
async def running_fleet(
    directory: Path, robots: Mapping[str, str], *, port: int = 0, settings: Mapping[str, str] | None = None
) -> AsyncIterator[Stack]:
    """Start `lockstep up` with several simulated robots, `{"left": "planar"}`; end it on leaving."""
    event_log = directory / "events.jsonl"
    named = [argument for name, kind in robots.items() for argument in ("--robot", f"{name}={kind}")]
    command = ("up", "--json", *named, "--port", str(port), "--robot-port", "0", "--event-log", str(event_log))
    async with _running(directory, command, event_log, settings) as stack:
        yield stack


@asynccontextmanager
async def running_console(
    directory: Path, robot: str, event_log: Path, extra: tuple[str, ...] = ()
) -> AsyncIterator[Stack]:
    """Start `lockstep serve` for a robot that runs already, at "tcp://host:port"; `event_log` is its own.

    `robot`: or "dial-in", for one that comes later.
    """
    async with _running(directory, ("serve", "--json", "--robot", robot, "--port", "0", *extra), event_log) as stack:
        yield stack


@asynccontextmanager
async def _running(
    directory: Path,
    arguments: tuple[str, ...],
    event_log: Path,
    settings: Mapping[str, str] | None = None,
    lockstep: Path | None = None,
    ready_seconds: float = READY_SECONDS,
) -> AsyncIterator[Stack]:
    # One state directory for all runs of a test: the key in it lets a page's token outlive a restart of the console.
    environment = {"PYTHONWARNINGS": "default", "LOCKSTEP_STATE_DIR": str(directory / "state"), **(settings or {})}
    command = (*FIRST, str(lockstep or LOCKSTEP), *arguments)
    async with running_process(*command, environment=environment, ready_seconds=ready_seconds) as (running, links):
        try:
            yield Stack(running=running, event_log=event_log, **links)
        finally:
            if not await running.end():
                raise RuntimeError("lockstep did not end on SIGTERM")
