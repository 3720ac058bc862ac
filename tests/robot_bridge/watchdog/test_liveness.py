"""A bridge that hangs for ever: its process ends, and says why; real processes, a real service manager's socket."""

import asyncio
import contextlib
import os
import signal
import socket
import sys
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from lockstep.protocol.errors import LinkError
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.settings import BridgeSettings
from lockstep.robot_bridge.watchdog.liveness import EXIT_HUNG
from tests.robot_bridge.bridge_helpers import RecordingRobot, operator

A_BRIDGE = """
import asyncio, ctypes, os, pathlib, sys, time
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.watchdog.liveness import Liveness
from lockstep.robot_bridge.robots.planar.robot import PlanarRobot
from lockstep.robot_bridge.service_manager import ServiceManager
from lockstep.robot_bridge.settings import BridgeSettings

class Robot(PlanarRobot):
    def sources(self):
        return ()

    def tick(self):
        if os.path.exists("block"):
            time.sleep(60)
        if os.path.exists("lock"):
            ctypes.PyDLL(None).sleep(60)  # native code that keeps the interpreter's lock
        super().tick()

    def close(self):
        if os.path.exists("close"):
            time.sleep(60)

async def main():
    liveness = Liveness(0.5, ServiceManager(os.environ))
    async with Bridge(Robot(), BridgeSettings(port=0, state_dir=pathlib.Path("state")), liveness=liveness) as bridge:
        print(bridge.address[1], flush=True)
        await asyncio.get_running_loop().run_in_executor(None, sys.stdin.readline)

asyncio.run(main())
if os.path.exists("exit"):
    time.sleep(60)
"""


class Running:
    def __init__(self, process: asyncio.subprocess.Process, port: int) -> None:
        self.process = process
        self.address = ("127.0.0.1", port)

    async def ended(self) -> tuple[int | None, str]:
        """It is to end, if it does not by itself: its exit code and what it said."""
        async with asyncio.timeout(30):
            _, said = await self.process.communicate(b"")
        return self.process.returncode, said.decode()


@asynccontextmanager
async def running(directory: Path, **environment: str) -> AsyncIterator[Running]:
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-c", A_BRIDGE),
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
        cwd=directory,
        env={**os.environ, "PYTHONPATH": os.getcwd(), **environment},
    )
    try:
        assert process.stdout is not None
        async with asyncio.timeout(30):
            port = int(await process.stdout.readline())
        yield Running(process, port)
    finally:
        with contextlib.suppress(ProcessLookupError):
            process.kill()
        await process.communicate()


@asynccontextmanager
async def bridge_after(directory: Path) -> AsyncIterator[str]:
    """The reason for which the next bridge with the same state begins stopped; "" when it does not."""
    settings = BridgeSettings(port=0, state_dir=directory / "state")
    async with Bridge(RecordingRobot(), settings) as bridge, operator(bridge, armed=False) as driver:
        yield driver.feedback.stop.reason if driver.feedback.stop.stopped else ""


async def test_a_tick_that_never_returns_ends_the_process_with_a_message_and_the_next_bridge_begins_stopped(
    tmp_path: Path,
) -> None:
    async with running(tmp_path) as bridge:
        (tmp_path / "block").touch()
        assert await bridge.process.wait() == EXIT_HUNG
        _, said = await bridge.ended()
    assert "The robot bridge hung: no control tick for 0.5 s" in said
    assert "in tick" in said, "it says where it hangs"
    async with bridge_after(tmp_path) as reason:
        assert reason == "The robot bridge hung: no control tick for 0.5 s"
    async with bridge_after(tmp_path) as reason:  # nobody has reset it
        assert reason == "The robot bridge hung: no control tick for 0.5 s"


async def test_native_code_that_keeps_the_interpreter_ends_by_the_kernels_alarm(tmp_path: Path) -> None:
    async with running(tmp_path) as bridge:
        (tmp_path / "lock").touch()
        assert await bridge.process.wait() == -signal.SIGALRM
    async with bridge_after(tmp_path) as reason:
        assert "did not shut down cleanly" in reason


async def test_a_message_that_nobody_reads_does_not_keep_it_alive(tmp_path: Path) -> None:
    reader, writer = os.pipe()
    try:
        os.set_blocking(writer, False)
        with contextlib.suppress(BlockingIOError):
            while True:
                os.write(writer, bytes(65536))
        os.set_blocking(writer, True)
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-c", A_BRIDGE),
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            stderr=writer,
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": os.getcwd()},
        )
        try:
            assert process.stdout is not None
            async with asyncio.timeout(30):
                await process.stdout.readline()
                (tmp_path / "block").touch()
                assert await process.wait() == -signal.SIGALRM
        finally:
            with contextlib.suppress(ProcessLookupError):
                process.kill()
            await process.communicate()
    finally:
        os.close(reader)
        os.close(writer)


@pytest.mark.parametrize(("where", "code"), [("close", EXIT_HUNG), ("exit", -signal.SIGALRM)])
async def test_a_bridge_that_hangs_on_its_way_out_ends_too(where: str, code: int, tmp_path: Path) -> None:
    (tmp_path / where).touch()
    async with running(tmp_path) as bridge:
        assert (await bridge.ended())[0] == code


async def test_a_bridge_whose_ticks_go_on_lives_and_ends_in_order(tmp_path: Path) -> None:
    async with running(tmp_path) as bridge:
        async with operator(bridge) as driver:
            began = driver.feedback.time
            await driver.heard(lambda feedback: feedback.time - began > 1.5)  # three times the limit
        assert await bridge.ended() == (0, "")
    async with bridge_after(tmp_path) as reason:
        assert reason == ""


@pytest.fixture
def manager(tmp_path: Path) -> Iterator[socket.socket]:
    with contextlib.closing(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)) as listening:
        listening.bind(str(tmp_path / "notify"))
        listening.setblocking(False)
        yield listening


async def test_its_service_manager_hears_of_the_ticks_and_of_nothing_else(
    manager: socket.socket, tmp_path: Path
) -> None:
    """The signs of life come from the loop of the ticks: they end with it, however well its threads go on."""
    heard: list[bytes] = []
    loop = asyncio.get_running_loop()

    async def hear(count: int) -> None:
        async with asyncio.timeout(30):
            for _ in range(count):
                heard.append(await loop.sock_recv(manager, 100))

    environment = {"NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": "1000000"}
    async with running(tmp_path, **environment) as bridge:
        await hear(6)
        assert heard == [b"READY=1"] + [b"WATCHDOG=1"] * 5
        (tmp_path / "block").touch()
        with contextlib.suppress(LinkError, AssertionError, TimeoutError):
            async with operator(bridge) as driver:  # until it is silent
                while True:
                    await driver.heard(lambda feedback: False)
        with contextlib.suppress(BlockingIOError):
            while True:
                heard.append(manager.recv(100))
        heard.clear()
        assert await bridge.process.wait() == EXIT_HUNG
        with pytest.raises(BlockingIOError):
            manager.recv(100)
    (tmp_path / "block").unlink()
    async with running(tmp_path, **environment) as bridge:
        await hear(2)
        await bridge.ended()
        await hear(1)
        while heard[-1] == b"WATCHDOG=1":
            await hear(1)
    assert heard[0] == b"READY=1"
    assert heard[-1] == b"STOPPING=1"
