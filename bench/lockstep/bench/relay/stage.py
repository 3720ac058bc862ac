"""A console, a robot and several Janus in network namespaces: each a process that only knows its side's network."""

import asyncio
import json
import os
import re
import sys
from collections.abc import AsyncIterator, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from playwright.async_api import Browser

from lockstep.bench.browsers.chromium import chromium_program, running_chromium
from lockstep.bench.emulator.namespace.namespaces import OPERATOR_ADDRESS, ROBOT_ADDRESS, Namespaces, Side
from lockstep.bench.relay.janus import JANUS_READY, janus_command

__all__ = ["FIRST_PORT", "ROOM", "Process", "RelayStage", "relay_stage"]

ROOM = 4711
START_SECONDS = 60.0
FIRST_PORT = 8188
CONSOLE_PORT = 8000
LINES = 400  # lines of its output that are kept
ADDRESSES: dict[Side, str] = {"robot": ROBOT_ADDRESS, "operator": OPERATOR_ADDRESS}


@dataclass
class Process:
    """A process in a namespace. `lines`: the last ones of its output."""

    process: asyncio.subprocess.Process
    lines: list[str] = field(default_factory=list)
    grew: asyncio.Event = field(default_factory=asyncio.Event)
    reader: asyncio.Task[None] | None = None

    @property
    def pid(self) -> int:
        return self.process.pid

    async def line(self, pattern: str, seconds: float = START_SECONDS) -> str:
        """Wait for the first line that matches, and return it."""
        async with asyncio.timeout(seconds):
            while True:
                for line in self.lines:
                    if re.search(pattern, line):
                        return line
                if self.process.returncode is not None:
                    raise RuntimeError("it ended: " + "\n".join(self.lines[-20:]))
                self.grew.clear()
                await self.grew.wait()

    async def read(self) -> None:
        if self.process.stdout is None:
            return
        async for line in self.process.stdout:
            self.lines.append(line.decode(errors="replace").rstrip())
            del self.lines[:-LINES]
            self.grew.set()
        self.grew.set()

    def cpu_seconds(self) -> float:
        """Return the processor time of the process itself so far, user and system."""
        fields = Path(f"/proc/{self.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def said(self) -> list[dict[str, Any]]:
        """Return its lines that are JSON, as far as they are kept."""
        return [json.loads(line) for line in self.lines if line.startswith("{")]

    async def end(self) -> None:
        self.process.terminate()
        await self.process.wait()

    async def kill(self) -> None:
        """Kill the process, like a machine that is switched off."""
        self.process.kill()
        await self.process.wait()


@dataclass
class RelayStage:
    """The running processes. Enter `relay_stage` to have one."""

    spaces: Namespaces
    folder: Path
    stack: AsyncExitStack
    janus: list[Process] = field(default_factory=list)
    console: Process | None = None
    links: dict[str, str] = field(default_factory=dict)

    async def start(self, side: Side, command: Sequence[str], **options: object) -> Process:
        process = await self.spaces.start(
            side, command, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.STDOUT, **options
        )
        started = Process(process)
        started.reader = asyncio.get_running_loop().create_task(started.read())
        self.stack.push_async_callback(_end, started)
        return started

    async def add_janus(self, side: Side, number: int, **options: str) -> Process:
        command = janus_command(
            self.folder / f"janus-{number}", ADDRESSES[side], FIRST_PORT + number, number=number, **options
        )
        started = await self.start(side, command)
        await started.line(JANUS_READY)
        self.janus.append(started)
        return started

    async def restart_janus(self, side: Side, number: int) -> None:
        """Start a Janus again after it was killed; it remembers nothing."""
        await self.add_janus(side, number)
        self.janus[number] = self.janus.pop()

    async def add_console(
        self, relays: Sequence[tuple[Side, int]], *extra: str, robot: str = "planar", **settings: str
    ) -> None:
        """Start `lockstep up` on the robot's side, publishing into these Janus."""
        arguments = [f"--relay=janus:ws://{ADDRESSES[side]}:{FIRST_PORT + number}/{ROOM}" for side, number in relays]
        command = [
            *(str(Path(sys.executable).with_name("lockstep")), "up", "--json", "--robot", robot, "--robot-port", "0"),
            *("--host", ROBOT_ADDRESS, "--port", str(CONSOLE_PORT), "--state-dir", str(self.folder / "state")),
            *("--event-log", str(self.folder / "events.jsonl"), *arguments, *extra),
        ]
        environment = os.environ | {f"LOCKSTEP_{name.upper()}": value for name, value in settings.items()}
        self.console = await self.start("robot", command, env=environment)
        self.links = json.loads(await self.console.line(r'^\{"console"'))

    @asynccontextmanager
    async def chromium(self, side: Side) -> AsyncIterator[Browser]:
        """Start Chromium in that side's network, through a script that enters the network first."""
        anchor = await self.start(side, ["sleep", "infinity"])
        script = self.folder / f"chromium-{side}"
        script.write_text(f'#!/bin/sh\nexec nsenter --net=/proc/{anchor.pid}/ns/net {chromium_program()} "$@"\n')
        script.chmod(0o700)
        # The page is served without TLS, at an address that is not loopback.
        secure = f"--unsafely-treat-insecure-origin-as-secure=http://{ROBOT_ADDRESS}:{CONSOLE_PORT}"
        async with running_chromium(executable=script, flags=[secure]) as browser:
            yield browser

    async def add_driver(self, side: Side = "operator", interval: float = 0.0) -> Process:
        """Start an operator that drives from now on; `interval`: seconds between a feedback and the next command."""
        command = [sys.executable, "-m", "lockstep.bench.relay.driver", self.links["operator"], str(interval)]
        driver = await self.start(side, command)
        await driver.line(r'^\{"at"')
        return driver


async def _end(started: Process) -> None:
    if started.reader is not None:
        await asyncio.wait([started.reader], timeout=5.0)
        started.reader.cancel()
        await asyncio.gather(started.reader, return_exceptions=True)


@asynccontextmanager
async def relay_stage(folder: Path, profile: str = "perfect") -> AsyncIterator[RelayStage]:
    """Start the two namespaces, and yield the stage.

    Raises:
        NamespacesUnavailable: this machine or user cannot have network namespaces.
    """
    async with AsyncExitStack() as stack:
        readers = await stack.enter_async_context(AsyncExitStack())  # after the processes have ended
        spaces = await stack.enter_async_context(Namespaces(profile))
        yield RelayStage(spaces, folder, readers)
