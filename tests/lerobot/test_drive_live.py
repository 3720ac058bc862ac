"""`lockstep drive --teleop`: a leader behind LeRobot's classes drives an arm, by the keys of a terminal."""

import asyncio
import os
import pty
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import numpy as np
import pytest

from lockstep.bench.harness.stack import LOCKSTEP
from lockstep.client import Console
from tests.lerobot.commands import PATIENCE, Arm, environment, lerobot_python, newest

pytestmark = [pytest.mark.long, pytest.mark.timeout(1500)]

REPEAT = 0.04  # s between two characters of a held key
SLEW = 60.0  # degrees/s, of the arm's goals
TICK = 0.2  # s that a goal is older than its feedback at most: the arm's watchdog


class Terminal:
    """The terminal in which the command runs."""

    def __init__(self, master: int, process: asyncio.subprocess.Process) -> None:
        self.process = process
        self.said = ""
        self._master = master
        self._grew = asyncio.Event()
        asyncio.get_running_loop().add_reader(master, self._read)

    def type(self, text: str) -> None:
        os.write(self._master, text.encode())

    async def says(self, words: str, times: int = 1) -> None:
        async with asyncio.timeout(PATIENCE):
            while self.said.count(words) < times:
                self._grew.clear()
                await self._grew.wait()

    @asynccontextmanager
    async def holding(self, key: str) -> AsyncIterator[None]:
        async def repeat() -> None:
            while True:
                self.type(key)
                await asyncio.sleep(REPEAT)

        task = asyncio.create_task(repeat())
        try:
            yield
        finally:
            task.cancel()
            await asyncio.wait([task])

    def _read(self) -> None:
        try:
            self.said += os.read(self._master, 4096).decode(errors="replace")
        except OSError:  # the command has ended
            asyncio.get_running_loop().remove_reader(self._master)
        self._grew.set()


@asynccontextmanager
async def driving(directory: Path, link: str, *flags: str) -> AsyncIterator[Terminal]:
    master, slave = pty.openpty()
    process = await asyncio.create_subprocess_exec(
        *(str(LOCKSTEP), "drive", link, "--lerobot-python", lerobot_python(), *flags),
        stdin=slave,
        stdout=slave,
        stderr=slave,
        env={**os.environ, **environment(directory)},
        start_new_session=True,
    )
    os.close(slave)
    terminal = Terminal(master, process)
    try:
        yield terminal
    finally:
        if process.returncode is None:
            process.terminate()
            async with asyncio.timeout(PATIENCE):
                await process.wait()
        asyncio.get_running_loop().remove_reader(master)
        os.close(master)


async def test_the_leader_drives_only_while_the_key_is_held(arm: Arm, tmp_path: Path) -> None:
    leader = ("--teleop", "scripted", "--teleop.discover_packages_path=tests.lerobot.parts", "--teleop.swing=20")
    async with (
        Console(arm.stack.observer, audio=False, video=False) as watching,
        driving(tmp_path, arm.stack.operator, *leader) as terminal,
    ):
        await terminal.says("hold the space bar")
        await newest(watching)
        assert watching.feedback is not None
        start = list(watching.feedback.axes)
        goals: list[float] = []
        times: list[float] = []  # s, of the bridge

        async def watch() -> None:
            async for feedback in watching.feedbacks():
                if feedback.goals and feedback.goals[0] is not None:
                    goals.append(feedback.goals[0])
                    times.append(feedback.time)

        task = asyncio.create_task(watch())
        try:
            terminal.type(" ")  # a tap
            await asyncio.sleep(1.0)
            assert watching.feedback.axes == pytest.approx(start, abs=0.01)
            async with terminal.holding(" "):
                await terminal.says("drives")
                async with asyncio.timeout(PATIENCE):
                    while not goals or max(goals) - min(goals) < 10.0:  # noqa: ASYNC110
                        await asyncio.sleep(0.05)
            await terminal.says("rests")
            async with asyncio.timeout(PATIENCE):
                while not watching.feedback.at_rest:  # noqa: ASYNC110
                    await asyncio.sleep(0.05)
            stood = list(watching.feedback.axes)
            await asyncio.sleep(1.0)  # the leader swings on
            assert watching.feedback.axes == pytest.approx(stood, abs=0.01)
        finally:
            task.cancel()
            await asyncio.wait([task])
        terminal.type("q")
        async with asyncio.timeout(PATIENCE):
            assert await terminal.process.wait() == 0
        steps = np.abs(np.diff(goals))
        assert (steps <= SLEW * (np.diff(times) + TICK)).all()  # no leap


async def test_without_a_terminal_it_says_so(arm: Arm, tmp_path: Path) -> None:
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "lockstep.client.lead.cli", arm.stack.operator, "--lerobot-python", lerobot_python()),
        *("--teleop=scripted", "--teleop.discover_packages_path=tests.lerobot.parts"),
        stdin=asyncio.subprocess.DEVNULL,
        stderr=asyncio.subprocess.PIPE,
        env={**os.environ, **environment(tmp_path)},
    )
    async with asyncio.timeout(PATIENCE):
        _, said = await process.communicate()
    assert process.returncode == 1
    assert "terminal" in said.decode().splitlines()[-1]
