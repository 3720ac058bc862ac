"""The robot in C when its loop hangs: its event log is a pipe that nobody reads, so that a write never returns."""

import asyncio
import contextlib
import fcntl
import json
import os
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

from lockstep.protocol.errors import LinkError
from tests.docs.examples.robots import moving
from tests.robot_bridge.bridge_helpers import operator
from tests.support.c_robot import built_c_robot

F_SETPIPE_SZ = 1031  # linux/fcntl.h
HUNG = 3  # its exit code
PATIENCE = 40.0  # s; it gives up after 10


class HangingRobot:
    """Hangs while `reads` is false, as soon as the pipe is full."""

    def __init__(self, process: asyncio.subprocess.Process, address: tuple[str, int], pipe: int) -> None:
        self.process = process
        self.address = address
        self._pipe = pipe
        self._log = bytearray()
        self._grew = asyncio.Event()

    def read(self, on: bool) -> None:
        loop = asyncio.get_running_loop()
        if on:
            loop.add_reader(self._pipe, self._take)
        else:
            loop.remove_reader(self._pipe)

    def _take(self) -> None:
        self._log += os.read(self._pipe, 65536)
        self._grew.set()

    async def logged(self, kind: str) -> dict[str, Any]:
        """Its first line of this kind."""
        async with asyncio.timeout(PATIENCE):
            while True:
                for line in self._log.decode().splitlines(keepends=True):
                    if line.endswith("\n") and (found := json.loads(line))["kind"] == kind:
                        return dict(found)
                self._grew.clear()
                await self._grew.wait()


@asynccontextmanager
async def hanging_robot(directory: Path) -> AsyncIterator[HangingRobot]:
    log = directory / "log"
    os.mkfifo(log)
    pipe = os.open(log, os.O_RDONLY | os.O_NONBLOCK)
    fcntl.fcntl(pipe, F_SETPIPE_SZ, 4096)
    program = await asyncio.to_thread(built_c_robot)
    process = await asyncio.create_subprocess_exec(
        *(str(program), "--port", "0", "--event-log", str(log)),
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
    )
    try:
        assert process.stdout is not None
        async with asyncio.timeout(PATIENCE):
            address = json.loads(await process.stdout.readline())["robot"]
        robot = HangingRobot(process, ("127.0.0.1", int(address.rpartition(":")[2])), pipe)
        robot.read(True)
        yield robot
        robot.read(False)
    finally:
        with contextlib.suppress(ProcessLookupError):
            process.kill()
        await process.communicate()
        os.close(pipe)


async def drive_until_it_hangs(robot: HangingRobot) -> None:
    with contextlib.suppress(LinkError, AssertionError, TimeoutError):
        async with operator(robot) as driver:
            await driver.drive(moving(driver))
            robot.read(False)
            while True:
                await driver.drive(moving(driver))


async def test_a_robot_whose_loop_was_held_up_rests_without_a_ramp_and_wants_a_neutral_command(tmp_path: Path) -> None:
    async with hanging_robot(tmp_path) as robot:
        await drive_until_it_hangs(robot)
        robot.read(True)
        assert (await robot.logged("stall"))["seconds"] > 0.15
        async with operator(robot, armed=False) as driver:
            assert driver.feedback.at_rest
            assert (await driver.refused(driver.command(moving(driver)))).reason == "not_neutral"
            await driver.arm()
            await driver.drive(moving(driver))
        robot.process.terminate()
        assert await robot.process.wait() == 0


async def test_a_robot_that_hangs_for_good_ends_with_a_message(tmp_path: Path) -> None:
    async with hanging_robot(tmp_path) as robot:
        await drive_until_it_hangs(robot)
        async with asyncio.timeout(PATIENCE):
            assert await robot.process.wait() == HUNG
        assert robot.process.stderr is not None
        assert "c_robot hung" in (await robot.process.stderr.read()).decode()
