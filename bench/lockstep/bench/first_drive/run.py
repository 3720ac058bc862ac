"""Types the commands of docs/tutorials/own-robot.md and ros2.md, from the first one to a robot that moves."""

import asyncio
import re
import sys
import time
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

from lockstep.bench.harness.free_port import free_port
from lockstep.bench.harness.processes import ProcessFailed, Running, spawn_here, started
from lockstep.bench.harness.stack import LOCKSTEP

__all__ = ["Driven", "drive_discovered", "drive_template", "driven_template"]

SECONDS = 120.0  # for each of the commands
LINK = r"To drive, open: +(\S+)"
DRIVER = "lockstep.bench.first_drive.driver"

Say = Callable[[str], None]


class Driven(NamedTuple):
    """A robot that was driven, and whose console still runs."""

    link: str  # the operator's
    seconds: dict[str, float]  # from the first command until each step was done


class _Terminal:
    """One in which commands are typed, and the seconds since the first of them."""

    def __init__(self, folder: Path, say: Say) -> None:
        self._folder = folder
        self._say = say
        self._began = time.monotonic()
        self.seconds: dict[str, float] = {}

    async def type(self, *command: str) -> None:
        """Run a command to its end.

        Raises:
            ProcessFailed: it failed, or took too long.
        """
        async with self.running(*command) as running:
            status: int | None = None
            with suppress(TimeoutError):
                async with asyncio.timeout(SECONDS):
                    status = await running.wait()
            if status != 0:
                raise ProcessFailed(command, running.output.lines)

    @asynccontextmanager
    async def running(self, *command: str, folder: Path | None = None) -> AsyncIterator[Running]:
        """Start a command, which is ended on leaving. `folder`: where, if not in the terminal's."""

        async def spawn(command: Sequence[str], /, **options: Any) -> Any:
            return await spawn_here(command, cwd=folder or self._folder, **options)

        self._say(" ".join(command))
        async with started(command, spawn=spawn) as running:
            yield running

    def note(self, what: str) -> None:
        """Note what is done now."""
        self.seconds[what] = round(time.monotonic() - self._began, 1)
        self._say(f"{what} after {self.seconds[what]} s")

    async def drive(self, console: Running) -> Driven:
        """Take the link that `lockstep up` prints, and drive by it."""
        found = re.search(LINK, await console.line(LINK, SECONDS))
        self.note("links")
        assert found is not None
        async with self.running(sys.executable, "-m", DRIVER, found[1]) as driver:
            await driver.read(SECONDS)
        self.note("driven")
        return Driven(found[1], self.seconds)


async def drive_template(folder: Path, say: Say) -> dict[str, float]:
    """Write a robot from the template, start it and drive it; return the seconds until each step was done.

    Raises:
        ProcessFailed: a command failed.
    """
    async with driven_template(folder, say) as driven:
        return driven.seconds


@asynccontextmanager
async def driven_template(folder: Path, say: Say, *, robot: str = "my_arm:MyArm") -> AsyncIterator[Driven]:
    """Write a robot from the template, start it and drive it; end its console on leaving.

    `robot`: the class that is started.

    Raises:
        ProcessFailed: a command failed.
    """
    terminal = _Terminal(folder, say)
    await terminal.type(LOCKSTEP, "robot", "new", "my_arm")
    terminal.note("written")
    up = (LOCKSTEP, "up", "--robot", robot, *_own(folder))
    async with terminal.running(*up, folder=folder / "my_arm") as console:
        yield await terminal.drive(console)


async def drive_discovered(folder: Path, python: str, node: Path, say: Say) -> dict[str, float]:
    """Have the file of a running ROS 2 robot written, start with it and drive; return the seconds as `drive_template`.

    `python`: of the ROS installation. `node`: the robot's, a Python program, which is started before the time counts.

    Raises:
        ProcessFailed: a command failed.
    """
    async with started((python, str(node))):
        terminal = _Terminal(folder, say)
        with_python = ("--robot-python", python)
        await terminal.type(LOCKSTEP, "ros2", "discover", "--out", "mine.yaml", "--yes", *with_python)
        terminal.note("written")
        async with terminal.running(LOCKSTEP, "up", "--ros2", "mine.yaml", *with_python, *_own(folder)) as console:
            await terminal.drive(console)
        return terminal.seconds


def _own(folder: Path) -> tuple[str, ...]:
    """Return options that keep `lockstep up` apart from others on this machine."""
    ports = ("--port", str(free_port()), "--robot-port", str(free_port()))
    return (*ports, "--state-dir", str(folder / "state"))
