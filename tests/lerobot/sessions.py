"""Sessions that are recorded through a real console and bridge, for datasets."""

import asyncio
import math
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager, suppress
from pathlib import Path

from lockstep.bench.harness.stack import LOCKSTEP
from lockstep.client import CommandRefused, Console
from tests.lerobot.commands import ROOT
from tests.support.stack import Stack, running_stack

__all__ = ["PATIENCE", "drive", "following", "recorded_stack", "so101_joints", "so101_tool"]

PATIENCE = 600.0
Motion = Callable[[float, Mapping[str, float]], dict[str, float]]
"""Values by axis after some seconds, from where the axes were at the beginning."""
PASSING = ("late", "link_down", "not_neutral", "rested")


@asynccontextmanager
async def recorded_stack(directory: Path, robot: str, recordings: Path) -> AsyncIterator[Stack]:
    """`lockstep up` that records, with the event drawn into each picture."""
    settings = {"LOCKSTEP_EPISODES__COUNTDOWN_SECONDS": "0", "SO101_MODEL_FOLDER": str(ROOT / ".so101")}
    extra = ("--record", str(recordings), "--event-strip")
    async with running_stack(directory, robot=robot, extra=extra, settings=settings, ready_seconds=PATIENCE) as stack:
        yield stack


@asynccontextmanager
async def following(directory: Path, recordings: Path, dataset: Path, *flags: str) -> AsyncIterator[list[str]]:
    """`lockstep export --follow`; yields the lines that it says."""
    command = ("export", "--to", "lerobot", "--follow", "--out", str(dataset), "--dir", str(recordings), *flags)
    process = await asyncio.create_subprocess_exec(
        *(str(LOCKSTEP), *command, "--state-dir", str(directory / "follow")), stdout=asyncio.subprocess.PIPE
    )
    said: list[str] = []

    async def read() -> None:
        assert process.stdout is not None
        async for line in process.stdout:
            said.append(line.decode().strip())

    reading = asyncio.create_task(read())
    try:
        async with asyncio.timeout(PATIENCE):
            while not said:  # noqa: ASYNC110
                await asyncio.sleep(0.05)
        yield said
    finally:
        with suppress(ProcessLookupError):
            process.terminate()
        await process.wait()
        await reading


async def drive(console: Console, motion: Motion, seconds: float) -> None:
    """Drive along a motion; again from where the robot is when a busy machine has held it up."""
    clock = asyncio.get_running_loop().time
    names = [axis.name for axis in console.description.axes]
    end = clock() + seconds
    while clock() < end:
        with suppress(CommandRefused):
            feedback = await console.arm()
            # A goal axis begins at its applied goal: the measured one hangs lower under its load.
            at = {
                name: goal if goal is not None else feedback.axes[place]
                for place, (name, goal) in enumerate(zip(names, feedback.goals or [None] * len(names), strict=True))
            }
            began = clock()
            while clock() < end:
                await console.drive(motion(clock() - began, at))
    await console.rest()


def so101_joints(seconds: float, at: Mapping[str, float]) -> dict[str, float]:
    swing = 0.25 * math.sin(seconds * 2.0)
    return {"shoulder_pan": at["shoulder_pan"] + swing, "elbow_flex": at["elbow_flex"] - 0.5 * swing}


def so101_tool(seconds: float, at: Mapping[str, float]) -> dict[str, float]:
    turn = ("tool.rx", "tool.ry", "tool.rz")
    place = {"tool.x": at["tool.x"], "tool.y": at["tool.y"] + 0.03 * math.sin(seconds * 2.0), "tool.z": at["tool.z"]}
    return place | {name: at[name] for name in turn}
