"""`lockstep up` as its user runs it: a process of its own on free ports, ended by its signal."""

import asyncio
import json
import os
import shutil
import signal
import sys
from collections.abc import AsyncIterator, Iterator, Mapping
from contextlib import asynccontextmanager, contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from lockstep.server.fleet.simulated import own_event_log
from tests.support.event_logs import PATIENCE, written

__all__ = ["Stack", "running_console", "running_fleet", "running_stack"]

START_SECONDS = 40.0  # a loaded two-core machine importing everything and opening GL
STOP_SECONDS = 15.0
# Root's Chromium gives itself and its sound a higher priority than all others, which no robot's machine has to share.
FIRST = ("nice", "-n", "-12") if os.geteuid() == 0 else ()
WITH_US = ("setpriv", "--pdeathsig", "TERM") if shutil.which("setpriv") else ()  # ended also when the tests are killed


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

    process: asyncio.subprocess.Process
    console: str
    operator: str
    observer: str
    supervisor: str
    robot: str = ""
    robots: dict[str, str] = field(default_factory=dict)
    event_log: Path
    skipped: int = 0
    output: list[str] = field(default_factory=list)  # its last lines on standard error

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
) -> AsyncIterator[Stack]:
    """Start `lockstep up`, wait until it says that it is ready, and end it on leaving. `lockstep`: another one's."""
    event_log = directory / "events.jsonl"
    command: tuple[str, ...] = ("up", "--json", "--robot", robot, "--port", str(port), "--robot-port", "0")
    command = (*command, "--event-log", str(event_log), *extra)
    async with _running(directory, command, event_log, settings, lockstep) as stack:
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
async def running_console(directory: Path, robot: str, event_log: Path) -> AsyncIterator[Stack]:
    """Start `lockstep serve` for a robot that runs already, at "tcp://host:port"; `event_log` is its own."""
    async with _running(directory, ("serve", "--json", "--robot", robot, "--port", "0"), event_log) as stack:
        yield stack


@asynccontextmanager
async def _running(
    directory: Path,
    arguments: tuple[str, ...],
    event_log: Path,
    settings: Mapping[str, str] | None = None,
    lockstep: Path | None = None,
) -> AsyncIterator[Stack]:
    # One state directory for all runs of a test: the key in it lets a page's token outlive a restart of the console.
    environment = os.environ | {"PYTHONWARNINGS": "default", "LOCKSTEP_STATE_DIR": str(directory / "state")}
    process = await asyncio.create_subprocess_exec(
        *(*FIRST, *WITH_US),
        *(str(lockstep or Path(sys.executable).with_name("lockstep")), *arguments),
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
        env=environment | dict(settings or {}),
    )
    output: list[str] = []
    reader = asyncio.create_task(_keep_last_lines(process, output))
    try:
        links = await _ready_line(process, output)
        yield Stack(process=process, event_log=event_log, output=output, **links)
    finally:
        await _end(process)
        await reader


async def _ready_line(process: asyncio.subprocess.Process, output: list[str]) -> dict[str, Any]:
    if process.stdout is None:
        raise RuntimeError("the process has no output to read")
    async with asyncio.timeout(START_SECONDS):
        line = await process.stdout.readline()
    if not line:
        raise RuntimeError("lockstep up ended before it was ready:\n" + "\n".join(output))
    links: dict[str, Any] = json.loads(line)
    return links


async def _keep_last_lines(process: asyncio.subprocess.Process, output: list[str]) -> None:
    if process.stderr is None:
        return
    async for line in process.stderr:
        output.append(line.decode(errors="replace").rstrip())
        del output[:-200]


async def _end(process: asyncio.subprocess.Process) -> None:
    if process.returncode is None:
        process.send_signal(signal.SIGTERM)
    try:
        async with asyncio.timeout(STOP_SECONDS):
            await process.wait()
    except TimeoutError:
        process.kill()
        await process.wait()
        raise RuntimeError("lockstep up did not end on SIGTERM") from None
