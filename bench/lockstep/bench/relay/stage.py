"""A console, a robot and several Janus in network namespaces: each a process that only knows its side's network."""

import json
import sys
from collections.abc import AsyncIterator, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from playwright.async_api import Browser

from lockstep.bench.browsers.chromium import chromium_program, running_chromium
from lockstep.bench.harness.processes import Running, started
from lockstep.bench.harness.stack import LOCKSTEP
from lockstep.bench.relay.janus import JANUS_READY, janus_command
from lockstep.emulator.namespace.namespaces import OPERATOR_ADDRESS, ROBOT_ADDRESS, Namespaces, Side

__all__ = ["FIRST_PORT", "ROOM", "RelayStage", "relay_stage"]

ROOM = 4711
FIRST_PORT = 8188
CONSOLE_PORT = 8000
ADDRESSES: dict[Side, str] = {"robot": ROBOT_ADDRESS, "operator": OPERATOR_ADDRESS}


@dataclass
class RelayStage:
    """The running processes. Enter `relay_stage` to have one."""

    spaces: Namespaces
    folder: Path
    stack: AsyncExitStack
    janus: list[Running] = field(default_factory=list)
    console: Running | None = None
    links: dict[str, str] = field(default_factory=dict)

    async def start(self, side: Side, command: Sequence[str], **environment: str) -> Running:
        spawn = partial(self.spaces.start, side)
        return await self.stack.enter_async_context(started(command, environment=environment, spawn=spawn))

    async def add_janus(self, side: Side, number: int, **options: str) -> Running:
        command = janus_command(
            self.folder / f"janus-{number}", ADDRESSES[side], FIRST_PORT + number, number=number, **options
        )
        running = await self.start(side, command)
        await running.line(JANUS_READY)
        self.janus.append(running)
        return running

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
            *(LOCKSTEP, "up", "--json", "--robot", robot, "--robot-port", "0"),
            *("--host", ROBOT_ADDRESS, "--port", str(CONSOLE_PORT), "--state-dir", str(self.folder / "state")),
            *("--event-log", str(self.folder / "events.jsonl"), *arguments, *extra),
        ]
        environment = {f"LOCKSTEP_{name.upper()}": value for name, value in settings.items()}
        self.console = await self.start("robot", command, **environment)
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

    async def add_driver(self, side: Side = "operator", interval: float = 0.0) -> Running:
        """Start an operator that drives from now on; `interval`: seconds between a feedback and the next command."""
        command = [sys.executable, "-m", "lockstep.bench.relay.driver", self.links["operator"], str(interval)]
        driver = await self.start(side, command)
        await driver.line(r'^\{"at"')
        return driver


@asynccontextmanager
async def relay_stage(folder: Path, profile: str = "perfect") -> AsyncIterator[RelayStage]:
    """Start the two namespaces, and yield the stage.

    Raises:
        NamespacesUnavailable: this machine or user cannot have network namespaces.
    """
    async with AsyncExitStack() as stack:
        spaces = await stack.enter_async_context(Namespaces(profile))
        yield RelayStage(spaces, folder, stack)
