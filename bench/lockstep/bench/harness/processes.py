"""Starts, measures and ends the processes of measurements and tests."""

import asyncio
import json
import os
import re
import shutil
import signal
import ssl
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import asynccontextmanager, suppress
from typing import Any, Protocol

from lockstep.bench.harness.process.output import ProcessOutput
from lockstep.bench.harness.process.usage import ProcessUsage
from lockstep.server.util.background_tasks import background_tasks

__all__ = ["ProcessFailed", "Running", "Spawn", "running_process", "spawn_here", "started"]

READY_SECONDS = 120.0  # on a busy machine; never waited for in full
STOP_SECONDS = 15.0
LOOK_SECONDS = 0.05  # between two tries to connect
OUTPUT_SECONDS = 5.0  # to read the rest of what an ended process has written
LINE_LIMIT = 1 << 20  # bytes
TOLD_LINES = 30


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
        output: what it has written
        usage: its processor time and memory
    """

    def __init__(self, process: asyncio.subprocess.Process, command: Sequence[str], output: ProcessOutput) -> None:
        self.process = process
        self.output = output
        self.usage = ProcessUsage(process.pid)
        self._command = command

    @property
    def pid(self) -> int:
        return self.process.pid

    async def line(self, pattern: str, seconds: float = READY_SECONDS) -> str:
        """Wait for the first line that matches, and return it.

        Raises:
            ProcessFailed: it ended, or `seconds` passed.
        """
        try:
            async with asyncio.timeout(seconds):
                while True:
                    for line in self.output.lines:
                        if re.search(pattern, line):
                            return line
                    await self._grown()
        except TimeoutError as error:
            raise ProcessFailed(self._command, self.output.lines) from error

    async def read(self, seconds: float) -> dict[str, Any]:
        """Return the next line of its standard output, which is JSON.

        Raises:
            ProcessFailed: it ended, or `seconds` passed.
        """
        try:
            async with asyncio.timeout(seconds):
                while not self.output.unread:
                    await self._grown()
        except TimeoutError as error:
            raise ProcessFailed(self._command, self.output.lines) from error
        found: dict[str, Any] = json.loads(self.output.unread.popleft())
        return found

    async def ask(self, question: str, seconds: float) -> dict[str, Any]:
        """Write a line and return the answer.

        Raises:
            ProcessFailed: as for `read`.
        """
        if self.process.stdin is not None:
            self.process.stdin.write(question.encode() + b"\n")
        return await self.read(seconds)

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
                        raise ProcessFailed(self._command, self.output.lines)
                    try:
                        _, writer = await asyncio.open_connection("127.0.0.1", port, ssl=context, server_hostname=name)
                    except OSError:
                        await asyncio.sleep(LOOK_SECONDS)
                        continue
                    writer.close()
                    return
        except TimeoutError as error:
            raise ProcessFailed(self._command, self.output.lines) from error

    async def wait(self) -> int:
        """Wait until it has ended and its output is read; return its status."""
        status = await self.process.wait()
        with suppress(TimeoutError):
            async with asyncio.timeout(OUTPUT_SECONDS):
                await self.output.complete.wait()
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
        await self.wait()
        return is_gentle

    def signal(self, number: signal.Signals) -> None:
        """Send a signal past the process object, whose `send_signal` may reap the child before its watcher does."""
        if self.process.returncode is None:
            with suppress(ProcessLookupError):
                os.kill(self.pid, number)

    async def _grown(self) -> None:
        """Wait for another line. Raises ProcessFailed if none can come."""
        if self.output.ended:
            await self.wait()
            raise ProcessFailed(self._command, self.output.lines)
        self.output.grew.clear()
        await self.output.grew.wait()


@asynccontextmanager
async def started(
    command: Sequence[str], *, environment: Mapping[str, str] | None = None, spawn: Spawn = spawn_here
) -> AsyncIterator[Running]:
    """Start a process, and end it on leaving. `environment`: added to that of this process."""
    pipe = asyncio.subprocess.PIPE
    process = await spawn(
        command, stdin=pipe, stdout=pipe, stderr=pipe, limit=LINE_LIMIT, env=os.environ | dict(environment or {})
    )
    output = ProcessOutput()
    async with background_tasks(output.read(process)):
        running = Running(process, command, output)
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
