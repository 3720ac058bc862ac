"""Runs LeRobot's own commands, and says where its Python is."""

import asyncio
import os
import shutil
import sys
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from lockstep.client import Console, NotArmed
from lockstep.protocol.messages import Feedback
from tests.support.stack import Stack

__all__ = [
    "PATIENCE",
    "ROOT",
    "Arm",
    "environment",
    "lerobot_python",
    "newest",
    "reach",
    "run_driving",
    "run_lerobot",
]

ROOT = Path(__file__).parents[2]
PATIENCE = 600.0  # s; PyTorch alone takes minutes to load where a process gets a tenth of a processor
ATTEMPTS = 4


def lerobot_python() -> str:
    """The interpreter that has LeRobot.

    Raises:
        RuntimeError: it was not installed.
    """
    python = ROOT / ".lerobot" / "bin" / "python"
    if not python.exists():
        raise RuntimeError("LeRobot is not installed for the tests: make test-long does it")
    return str(python)


def environment(directory: Path) -> dict[str, str]:
    """What LeRobot's processes of a test get: no hub, a home of their own, and the parts of the tests."""
    return {
        "HF_HUB_OFFLINE": "1",
        "HF_HOME": str(directory / "hub"),
        "HF_LEROBOT_HOME": str(directory / "lerobot"),
        "PYTHONPATH": str(ROOT),
        "TINY_ARM": str(directory / "trouble"),
    }


@dataclass
class Arm:
    """The running console of the arm.

    Attributes:
        directory: where the file `trouble` makes some (parts/tiny_arm.py)
    """

    stack: Stack
    directory: Path

    def trouble(self, what: str) -> None:
        (self.directory / "trouble").write_text(what)


async def newest(console: Console) -> Feedback:
    """Return the newest feedback; a console that has just connected may have none yet."""
    if console.feedback is not None:
        return console.feedback
    async with asyncio.timeout(PATIENCE):
        return await anext(console.feedbacks())


async def reach(console: Console, goals: dict[str, float]) -> Feedback:
    """Arm and drive there; again if a busy machine has held the arm up meanwhile.

    Raises:
        NotArmed: each time.
    """
    for _ in range(4):
        with suppress(NotArmed):
            await console.arm()
            return await console.move_to(goals)
    await console.arm()
    return await console.move_to(goals)


async def run_lerobot(directory: Path, command: str, *flags: str, link: str = "", patience: float = PATIENCE) -> str:
    """Run one of LeRobot's commands to its end; return all that it printed.

    Raises:
        AssertionError: it failed.
    """
    program, output = Path(lerobot_python()).with_name(command), directory / f"{command}.txt"
    with output.open("wb") as file:
        process = await asyncio.create_subprocess_exec(
            str(program),
            *flags,
            stdin=asyncio.subprocess.DEVNULL,
            stdout=file,
            stderr=asyncio.subprocess.STDOUT,
            env={**os.environ, **environment(directory), "LOCKSTEP_LINK": link, "LOCKSTEP_PYTHON": sys.executable},
        )
    try:
        async with asyncio.timeout(patience):
            await process.wait()
    except TimeoutError:
        process.kill()
        await process.wait()
        text = output.read_text(errors="replace")
        raise AssertionError(f"{command} did not end within {patience:g} s, and was killed: {text[-4000:]}") from None
    text = output.read_text(errors="replace")
    assert process.returncode == 0, text[-4000:]
    return text


async def run_driving(
    arm: Arm, directory: Path, command: str, *flags: str, dataset: Path | None = None, link: str = ""
) -> Stack:
    """Run a command that drives the arm; return the stack with what the bridge recorded since this run began.

    A bridge that the machine has held up beyond its watchdog wants a neutral command, and a refusal ends LeRobot's
    command: both are as documented. Then, and only if the bridge itself has recorded that, it is run again.

    Args:
        dataset: what the command writes, and an earlier run may have begun
        link: an operator's; "": that beside the console

    Raises:
        AssertionError: it failed otherwise, or each time.
    """
    for attempt in range(ATTEMPTS):
        here = await arm.stack.from_here()
        try:
            await run_lerobot(directory, command, *flags, link=link or arm.stack.operator)
        except AssertionError as error:
            stalls = await here.events("stall")  # by the watchdog, or by the bridge itself if that was held up as well
            if "NotArmed" not in str(error) or not stalls or attempt == ATTEMPTS - 1:
                raise
            if dataset is not None:
                shutil.rmtree(dataset)
        else:
            break
    return here
