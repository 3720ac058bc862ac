"""`python -m lockstep.client.pipe`, as a program of another Python speaks to it: a real console and a real robot."""

import asyncio
import json
import os
import signal
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from lockstep.client import Console
from tests.support.stack import Stack, running_stack

SECONDS = 30.0
ASK = """
import json
pan = {"unit": "deg", "minimum": -90, "maximum": 90, "slew": 60, "reach": 30}
asked = {"do": "open", "axes": {"pan.pos": pan}, "port": 0, "name": "test"}
text = json.dumps(asked).encode()
helper.stdin.write(len(text).to_bytes(4, "big") + text)
helper.stdin.flush()
assert helper.stdout.read(4)
"""  # the client's helper refuses it, the teleoperator's begins: both are ready then


class Pipe:
    def __init__(self, process: asyncio.subprocess.Process) -> None:
        assert process.stdin is not None
        assert process.stdout is not None
        self.process = process
        self._stdin, self._stdout = process.stdin, process.stdout

    def send(self, data: bytes) -> None:
        self._stdin.write(len(data).to_bytes(4, "big") + data)

    async def ask(self, do: str, **values: Any) -> tuple[dict[str, Any], list[bytes]]:
        self.send(json.dumps({"do": do, **values}).encode())
        async with asyncio.timeout(SECONDS):
            size = int.from_bytes(await self._stdout.readexactly(4), "big")
            answer: dict[str, Any] = json.loads(await self._stdout.readexactly(size))
            return answer, [await self._stdout.readexactly(each) for each in answer.pop("sizes")]

    async def end(self) -> int:
        """Close the pipe; return the exit code."""
        self._stdin.close()
        async with asyncio.timeout(SECONDS):
            return await self.process.wait()


@asynccontextmanager
async def running_pipe() -> AsyncIterator[Pipe]:
    both = asyncio.subprocess.PIPE
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-I", "-m", "lockstep.client.pipe", stdin=both, stdout=both
    )
    try:
        yield Pipe(process)
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()


@pytest.fixture
async def stack(tmp_path: Path) -> AsyncIterator[Stack]:
    async with running_stack(tmp_path) as found:
        yield found


async def test_it_describes_observes_drives_and_leaves_the_robot_at_rest(stack: Stack) -> None:
    async with running_pipe() as pipe:
        described, _ = await pipe.ask("open", link=stack.operator, name="pipe")
        assert [axis["name"] for axis in described["axes"]] == ["base.vx", "base.vy", "base.wz"]
        assert await pipe.ask("take_seat") == ({}, [])
        sent, _ = await pipe.ask("drive", values={"base.vx": 99.0})
        assert sent["sent"]["base.vx"] == described["axes"][0]["maximum"]
        await pipe.ask("drive", values={"base.vx": 0.1}, wait=False)
        observed, pictures = await pipe.ask("observe", seconds=10.0)
        assert observed["values"].keys() == {"base.vx", "base.vy", "base.wz"}
        assert observed["goals"] == {"base.vx": None, "base.vy": None, "base.wz": None}
        assert [len(each) for each in pictures] == [
            camera["width"] * camera["height"] * 3 for camera in described["cameras"]
        ]
        assert all(abs(observed["event"] - stamp) <= 4 for stamp in observed["stamps"])
        assert await pipe.end() == 0
    async with Console(stack.observer, video=False, audio=False) as console:
        assert console.seat.holder == ""
        async with asyncio.timeout(SECONDS):
            async for feedback in console.feedbacks():
                if feedback.at_rest:
                    break


async def test_errors_have_names_and_the_pipe_goes_on(stack: Stack) -> None:
    async with running_pipe() as pipe:
        for do, values, name in (
            ("observe", {}, "NotOpen"),
            ("open", {"link": "nowhere"}, "LinkFormatError"),
            ("fly", {}, "ValidationError"),
        ):
            answer, _ = await pipe.ask(do, **values)
            assert answer["error"] == name
        await pipe.ask("open", link=stack.observer)
        answer, _ = await pipe.ask("take_seat")
        assert (answer["error"], answer["reason"]) == ("SeatRefused", "not_allowed")
        answer, _ = await pipe.ask("drive", values={"wing": 1.0})
        assert answer["error"] == "CommandError"
        answer, _ = await pipe.ask("observe", seconds=0.2, max_age=0.0)
        assert answer["error"] == "NoFreshObservation"
        assert "overview" in answer["text"]


@pytest.mark.parametrize("data", [b"{", b"[]", b"\xff"])
async def test_what_is_no_frame_ends_it_with_a_reason(data: bytes) -> None:
    async with running_pipe() as pipe:
        pipe.send(data)
        async with asyncio.timeout(SECONDS):
            assert await pipe.process.wait() == 1


HELPERS = ["lockstep.client.pipe", "lockstep.robot_bridge.robots.lerobot.teleoperator_process"]


@pytest.mark.parametrize("module", HELPERS)
async def test_it_ends_with_a_killed_process_though_a_forked_one_keeps_the_pipe_open(module: str) -> None:
    """LeRobot forks processes that write pictures. A helper that lived on would keep the seat, or the port."""
    end, told = os.pipe()  # the helper alone keeps `told` open
    script = (
        "import os, subprocess, sys, time\n"
        f"helper = subprocess.Popen([sys.executable, '-I', '-m', {module!r}], stdin=-1, stdout=-1, stderr={told})\n"
        f"os.close({told})\n"
        f"{ASK}\n"
        "forked = os.fork()\n"
        "print(forked, flush=True) if forked else os.close(1)\n"
        "time.sleep(600)\n"
    )
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-c", script, stdout=asyncio.subprocess.PIPE, pass_fds=[told]
    )
    os.close(told)
    assert process.stdout is not None
    async with asyncio.timeout(SECONDS):
        forked = int(await process.stdout.readline())
    try:
        process.kill()
        await process.wait()
        reader = asyncio.StreamReader()
        transport, _ = await asyncio.get_running_loop().connect_read_pipe(
            lambda: asyncio.StreamReaderProtocol(reader), os.fdopen(end, "rb")
        )
        async with asyncio.timeout(SECONDS):
            await reader.read()
        transport.close()
    finally:
        os.kill(forked, signal.SIGKILL)


@pytest.mark.parametrize("module", HELPERS)
async def test_it_ends_with_a_process_that_ended_while_it_was_starting(module: str) -> None:
    """The test keeps the pipe open, as a forked process would."""
    script = (
        "import os, sys\n"
        "parent, (living, held) = os.getpid(), os.pipe()\n"
        "if os.fork(): os._exit(0)\n"
        "os.close(held)\n"
        "os.read(living, 1)\n"  # until the parent has ended
        f"os.execv(sys.executable, [sys.executable, '-I', '-m', {module!r}, str(parent)])\n"
    )
    both = asyncio.subprocess.PIPE
    process = await asyncio.create_subprocess_exec(sys.executable, "-c", script, stdin=both, stdout=both)
    assert process.stdin is not None
    assert process.stdout is not None
    async with asyncio.timeout(SECONDS):
        assert await process.stdout.read() == b""  # the helper has closed it
        process.stdin.close()
        await process.wait()
