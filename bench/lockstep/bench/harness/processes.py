"""Starts, measures and ends the processes of a measurement."""

import asyncio
import json
import os
import shutil
import signal
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

__all__ = ["ProcessFailed", "Running", "running_process"]

READY_SECONDS = 60.0
STOP_SECONDS = 15.0
LINE_LIMIT = 1 << 20  # bytes
KEPT_LINES = 30
TICKS = os.sysconf("SC_CLK_TCK")


class ProcessFailed(Exception):
    """A process ended, or was silent for too long; its last lines of output say why."""

    def __init__(self, command: Sequence[str], output: Sequence[str]) -> None:
        super().__init__(command, output)
        self.command = command
        self.output = output

    def __str__(self) -> str:
        return "\n".join([f"{' '.join(self.command)} did not do its work", *self.output])


class Running:
    """A process that speaks JSON lines on its standard output."""

    def __init__(self, process: asyncio.subprocess.Process, command: Sequence[str]) -> None:
        self.output: list[str] = []  # last lines on standard error
        self._process = process
        self._command = command

    @property
    def pid(self) -> int:
        return self._process.pid

    def cpu_seconds(self) -> float:
        """Return the processor time used so far, all threads, user and system (proc(5), fields 14 and 15)."""
        fields = Path(f"/proc/{self.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / TICKS

    def thread_seconds(self) -> dict[str, float]:
        """Return the same by name of threads, without ended threads; the main thread is called "main".

        From the scheduler's own account, which is finer than the ticks in `stat`.
        """
        found: dict[str, float] = {}
        for task in Path(f"/proc/{self.pid}/task").iterdir():
            with suppress(OSError):  # it has just ended
                nanoseconds = int((task / "schedstat").read_text().split()[0])
                name = "main" if task.name == str(self.pid) else (task / "comm").read_text().strip()
                found[name] = found.get(name, 0.0) + nanoseconds / 1e9
        return found

    async def read(self, seconds: float) -> dict[str, Any]:
        """Return the next line of its output.

        Raises:
            ProcessFailed: it ended, or `seconds` passed.
        """
        if self._process.stdout is None:
            raise ProcessFailed(self._command, self.output)
        try:
            async with asyncio.timeout(seconds):
                line = await self._process.stdout.readline()
        except TimeoutError as error:
            raise ProcessFailed(self._command, self.output) from error
        if not line:
            await self._process.wait()
            raise ProcessFailed(self._command, self.output)
        found: dict[str, Any] = json.loads(line)
        return found

    async def ask(self, question: str, seconds: float) -> dict[str, Any]:
        """Write a line and return the answer.

        Raises:
            ProcessFailed: as for `read`.
        """
        if self._process.stdin is not None:
            self._process.stdin.write(question.encode() + b"\n")
        return await self.read(seconds)

    def pause(self) -> None:
        """Stop the process where it is (SIGSTOP)."""
        self._signal(signal.SIGSTOP)

    def go_on(self) -> None:
        """Let the process go on after `pause`."""
        self._signal(signal.SIGCONT)

    async def kill(self) -> None:
        """Kill the process, as a crash does."""
        self._signal(signal.SIGKILL)
        await self._process.wait()

    def resident_bytes(self) -> int:
        """Return its memory in use (proc(5), statm field 2)."""
        return int(Path(f"/proc/{self.pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    async def keep_output(self) -> None:
        """Read its standard error until it ends."""
        if self._process.stderr is None:
            return
        async for line in self._process.stderr:
            self.output.append(line.decode(errors="replace").rstrip())
            del self.output[:-KEPT_LINES]

    async def end(self) -> None:
        """End it, gently first."""
        self._signal(signal.SIGTERM)
        self._signal(signal.SIGCONT)  # a paused process takes no other signal
        try:
            async with asyncio.timeout(STOP_SECONDS):
                await self._process.wait()
        except TimeoutError:
            self._process.kill()
            await self._process.wait()

    def _signal(self, number: signal.Signals) -> None:
        """Send a signal past the process object, whose `send_signal` may reap the child before its watcher does."""
        if self._process.returncode is None:
            with suppress(ProcessLookupError):
                os.kill(self.pid, number)


@asynccontextmanager
async def running_process(
    *command: str, ready_seconds: float = READY_SECONDS, environment: Mapping[str, str] | None = None
) -> AsyncIterator[tuple[Running, dict[str, Any]]]:
    """Start a process; yield it and the line with which it reports that it is ready.

    It is ended on leaving, and when this process is killed.

    Raises:
        ProcessFailed: it did not become ready.
    """
    setpriv = shutil.which("setpriv")
    process = await asyncio.create_subprocess_exec(
        *(() if setpriv is None else (setpriv, "--pdeathsig", "TERM")),
        *command,
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
        limit=LINE_LIMIT,
        env=None if environment is None else os.environ | environment,
    )
    running = Running(process, command)
    reader = asyncio.get_running_loop().create_task(running.keep_output())
    try:
        yield running, await running.read(ready_seconds)
    finally:
        await running.end()
        await reader
