"""The robot of docs/examples/c_robot: built once, run as a process of its own."""

import asyncio
import functools
import json
import shutil
import subprocess
import tempfile
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path

__all__ = ["SOURCES", "CRobot", "built_c_robot", "running_c_robot"]

SOURCES = Path(__file__).parents[2] / "docs" / "examples" / "c_robot"
STRICT = ("-Wall", "-Wextra", "-Werror")
SANITIZED = ("-g", "-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
PLAIN = ("-O2",)
BUILD_SECONDS = 120
STOP_SECONDS = 10.0


@functools.cache
def built_c_robot() -> Path:
    """The program, with the sanitizers where the compiler has them.

    Raises:
        RuntimeError: there is no compiler, or it finds fault with the sources.
    """
    compiler = shutil.which("cc")
    if compiler is None:
        raise RuntimeError("there is no C compiler: make test installs Debian's gcc")
    program = Path(tempfile.mkdtemp(prefix="lockstep-c-robot-")) / "c_robot"
    flags = SANITIZED if _compiles(compiler, program, SANITIZED) else PLAIN
    command = [compiler, *STRICT, *flags, "-o", str(program), *map(str, sorted(SOURCES.glob("*.c"))), "-lm"]
    built = subprocess.run(command, capture_output=True, text=True, timeout=BUILD_SECONDS)
    if built.returncode != 0:
        raise RuntimeError(built.stderr)
    return program


def _compiles(compiler: str, program: Path, flags: tuple[str, ...]) -> bool:
    """Whether the compiler has what the flags need: tried with the smallest program."""
    trial = subprocess.run(
        [compiler, *flags, "-x", "c", "-o", str(program), "-"],
        input="int main(void) { return 0; }",
        text=True,
        capture_output=True,
        timeout=BUILD_SECONDS,
    )
    return trial.returncode == 0


@dataclass
class CRobot:
    """A running one."""

    process: asyncio.subprocess.Process
    address: tuple[str, int]
    event_log: Path

    @property
    def url(self) -> str:
        return f"tcp://{self.address[0]}:{self.address[1]}"

    async def end(self) -> tuple[int, str]:
        """Ask it to end; its exit code, and what it complained about."""
        if self.process.returncode is None:
            self.process.terminate()
        async with asyncio.timeout(STOP_SECONDS):
            _, complaints = await self.process.communicate()
        return self.process.returncode or 0, complaints.decode(errors="replace")


@asynccontextmanager
async def running_c_robot(directory: Path) -> AsyncIterator[CRobot]:
    """Leaving fails when it crashed, or a sanitizer found something."""
    program = await asyncio.to_thread(built_c_robot)
    event_log = directory / "c_robot.jsonl"
    process = await asyncio.create_subprocess_exec(
        *(str(program), "--port", "0", "--event-log", str(event_log)),
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
    )
    try:
        if process.stdout is None:
            raise RuntimeError("the process has no output")
        async with asyncio.timeout(STOP_SECONDS):
            line = await process.stdout.readline()
        host, _, port = json.loads(line)["robot"].removeprefix("tcp://").rpartition(":")
        robot = CRobot(process, (host, int(port)), event_log)
        yield robot
        code, complaints = await robot.end()
        if code != 0 or complaints:
            raise AssertionError(f"the robot in C ended with {code}:\n{complaints}")
    finally:
        if process.returncode is None:
            process.kill()
            await process.communicate()
