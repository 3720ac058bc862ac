"""Starts, measures and ends the processes of measurements and tests."""

import asyncio
import json
import os
import re
import shutil
import signal
import ssl
from collections import deque
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any, Protocol

__all__ = ["ProcessFailed", "Running", "Spawn", "running_process", "spawn_here", "started"]

READY_SECONDS = 60.0
STOP_SECONDS = 15.0
LOOK_SECONDS = 0.05  # between two tries to connect
OUTPUT_SECONDS = 5.0  # to read the rest of what an ended process has written
LINE_LIMIT = 1 << 20  # bytes
KEPT_LINES = 400
TOLD_LINES = 30
TICKS = os.sysconf("SC_CLK_TCK")


class Spawn(Protocol):
    """Starts a process; `options` are those of `create_subprocess_exec`."""

    async def __call__(self, command: Sequence[str], /, **options: Any) -> asyncio.subprocess.Process: ...


async def spawn_here(command: Sequence[str], /, **options: Any) -> asyncio.subprocess.Process:
    """Start a process that is ended too when this process is killed."""
    setpriv = shutil.which("setpriv")
    with_this = () if setpriv is None else (setpriv, "--pdeathsig", "TERM")
    return await asyncio.create_subprocess_exec(*with_this, *command, **options)


class ProcessFailed(Exception):
    """A process ended, or was silent for too long; its last lines of output say why."""

    def __init__(self, command: Sequence[str], output: Sequence[str]) -> None:
        super().__init__(command, output)
        self.command = command
        self.output = output

    def __str__(self) -> str:
        return "\n".join([f"{' '.join(self.command)} did not do its work", *self.output[-TOLD_LINES:]])


class Running:
    """A process whose output is read as it comes.

    Attributes:
        process: the process itself
        lines: the last lines of its output
        errors: those of them on standard error
        unread: those of them on standard output that `read` has not returned
        grew: set when a line comes, and at the end
    """

    def __init__(self, process: asyncio.subprocess.Process, command: Sequence[str]) -> None:
        self.process = process
        self.lines: list[str] = []
        self.errors: list[str] = []
        self.unread = deque[str](maxlen=KEPT_LINES)
        self.grew = asyncio.Event()
        self._command = command
        self._has_said_all = False
        loop = asyncio.get_running_loop()
        self._readers = [loop.create_task(self._read_output()), loop.create_task(self._read_errors())]

    @property
    def pid(self) -> int:
        return self.process.pid

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

    def resident_bytes(self) -> int:
        """Return its memory in use (proc(5), statm field 2)."""
        return int(Path(f"/proc/{self.pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    async def line(self, pattern: str, seconds: float = READY_SECONDS) -> str:
        """Wait for the first line that matches, and return it.

        Raises:
            ProcessFailed: it ended, or `seconds` passed.
        """
        try:
            async with asyncio.timeout(seconds):
                while True:
                    for line in self.lines:
                        if re.search(pattern, line):
                            return line
                    await self._grown()
        except TimeoutError as error:
            raise ProcessFailed(self._command, self.lines) from error

    async def read(self, seconds: float) -> dict[str, Any]:
        """Return the next line of its standard output, which is JSON.

        Raises:
            ProcessFailed: it ended, or `seconds` passed.
        """
        try:
            async with asyncio.timeout(seconds):
                while not self.unread:
                    await self._grown()
        except TimeoutError as error:
            raise ProcessFailed(self._command, self.lines) from error
        found: dict[str, Any] = json.loads(self.unread.popleft())
        return found

    async def ask(self, question: str, seconds: float) -> dict[str, Any]:
        """Write a line and return the answer.

        Raises:
            ProcessFailed: as for `read`.
        """
        if self.process.stdin is not None:
            self.process.stdin.write(question.encode() + b"\n")
        return await self.read(seconds)

    def said(self) -> list[dict[str, Any]]:
        """Return its lines that are JSON, as far as they are kept."""
        return [json.loads(line) for line in self.lines if line.startswith("{")]

    async def listening(self, port: int, *, context: ssl.SSLContext | None = None) -> None:
        """Wait until it takes connections on this port of localhost. `context`: and TLS, with any certificate.

        Raises:
            ProcessFailed: it ended, or is not ready for too long.
        """
        name = None if context is None else "localhost"
        try:
            async with asyncio.timeout(READY_SECONDS):
                while True:
                    if self.process.returncode is not None:
                        await self.wait()
                        raise ProcessFailed(self._command, self.lines)
                    try:
                        _, writer = await asyncio.open_connection("127.0.0.1", port, ssl=context, server_hostname=name)
                    except OSError:
                        await asyncio.sleep(LOOK_SECONDS)
                        continue
                    writer.close()
                    return
        except TimeoutError as error:
            raise ProcessFailed(self._command, self.lines) from error

    async def wait(self) -> int:
        """Wait until it has ended and its output is read; return its status."""
        status = await self.process.wait()
        await asyncio.wait(self._readers, timeout=OUTPUT_SECONDS)
        return status

    def pause(self) -> None:
        """Stop the process where it is (SIGSTOP)."""
        self.signal(signal.SIGSTOP)

    def go_on(self) -> None:
        """Let the process go on after `pause`."""
        self.signal(signal.SIGCONT)

    async def kill(self) -> None:
        """Kill the process, as a crash does."""
        self.signal(signal.SIGKILL)
        await self.process.wait()

    async def end(self) -> bool:
        """End it, gently first; return False if it had to be killed."""
        self.signal(signal.SIGTERM)
        self.signal(signal.SIGCONT)  # a paused process takes no other signal
        is_gentle = True
        try:
            async with asyncio.timeout(STOP_SECONDS):
                await self.process.wait()
        except TimeoutError:
            is_gentle = False
            await self.kill()
        await asyncio.wait(self._readers, timeout=OUTPUT_SECONDS)
        for reader in self._readers:
            reader.cancel()
        return is_gentle

    def signal(self, number: signal.Signals) -> None:
        """Send a signal past the process object, whose `send_signal` may reap the child before its watcher does."""
        if self.process.returncode is None:
            with suppress(ProcessLookupError):
                os.kill(self.pid, number)

    async def _grown(self) -> None:
        """Wait for another line. Raises ProcessFailed if none can come."""
        if self._has_said_all:
            await self.wait()
            raise ProcessFailed(self._command, self.lines)
        self.grew.clear()
        await self.grew.wait()

    async def _read_output(self) -> None:
        if self.process.stdout is not None:
            async for line in self.process.stdout:
                text = line.decode(errors="replace").rstrip()
                self.unread.append(text)
                self._keep(text)
        self._has_said_all = True
        self.grew.set()

    async def _read_errors(self) -> None:
        if self.process.stderr is not None:
            async for line in self.process.stderr:
                text = line.decode(errors="replace").rstrip()
                self.errors.append(text)
                del self.errors[:-KEPT_LINES]
                self._keep(text)

    def _keep(self, line: str) -> None:
        self.lines.append(line)
        del self.lines[:-KEPT_LINES]
        self.grew.set()


@asynccontextmanager
async def started(
    command: Sequence[str], *, environment: Mapping[str, str] | None = None, spawn: Spawn = spawn_here
) -> AsyncIterator[Running]:
    """Start a process, and end it on leaving. `environment`: added to that of this process."""
    pipe = asyncio.subprocess.PIPE
    process = await spawn(
        command, stdin=pipe, stdout=pipe, stderr=pipe, limit=LINE_LIMIT, env=os.environ | dict(environment or {})
    )
    running = Running(process, command)
    try:
        yield running
    finally:
        await running.end()


@asynccontextmanager
async def running_process(
    *command: str,
    ready_seconds: float = READY_SECONDS,
    environment: Mapping[str, str] | None = None,
) -> AsyncIterator[tuple[Running, dict[str, Any]]]:
    """Start a process; yield it and the line with which it reports that it is ready.

    It is ended on leaving, and when this process is killed.

    Raises:
        ProcessFailed: it did not become ready.
    """
    async with started(command, environment=environment) as running:
        yield running, await running.read(ready_seconds)
