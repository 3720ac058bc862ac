"""Faults in each phase of an episode: a killed console or robot, a full disk, a camera that hangs."""

import asyncio
import os
import shutil
import signal
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, Literal, get_args

from lockstep.bench.episodes.dataset import Kept
from lockstep.bench.episodes.session import visit
from lockstep.bench.episodes.turns import Turn
from lockstep.bench.episodes.visits import places_near
from lockstep.bench.harness.processes import Running, started
from lockstep.bench.harness.stack import LOCKSTEP
from lockstep.client import Console, ConsoleLost, EpisodeRefused
from lockstep.protocol.episodes import EpisodeState

__all__ = ["DISK_FAULTS", "FAULTS", "ROBOT", "FaultName", "FaultRun", "meet", "settings_of"]

FaultName = Literal[
    "kill-countdown", "kill-open", "kill-keeping", "kill-robot", "kill-export", "disk-low", "disk-full", "camera-hangs"
]
FAULTS: Final[tuple[FaultName, ...]] = get_args(FaultName)
DISK_FAULTS: Final = ("disk-low", "disk-full")

ROBOT: Final = "lockstep.bench.episodes.hanging_camera:HangingCameraArm"
TASK: Final = "visit a place"
LONG_COUNTDOWN: Final = "4"
SECONDS: Final = 60.0  # for anything that is waited for
LOW_BYTES: Final = 8 << 20  # that are to stay free on it


@dataclass
class FaultRun:
    """The parts of one run, and what it finds."""

    fault: FaultName
    folder: Path
    bridge: Running
    console: Running
    driver: Console
    name: str = "Ada"  # of the driver
    kept: list[Kept] = field(default_factory=list)  # that must be in the dataset
    perhaps: list[Kept] = field(default_factory=list)  # that may be in it: nobody was told
    said: list[str] = field(default_factory=list)  # by the console, at the time
    wrong: list[str] = field(default_factory=list)
    places: list[dict[str, float]] = field(default_factory=list)
    visited: int = 0

    @property
    def state(self) -> EpisodeState:
        return self.driver.episodes.state

    async def drive(self) -> int:
        """Visit the next place; return the event of the last answer."""
        if self.driver.feedback is None:
            await anext(aiter(self.driver.feedbacks()))
        assert self.driver.feedback is not None
        if not self.places:
            self.places = places_near(self.driver.description, self.driver.feedback)
        await visit(self.driver, self.places[self.visited % len(self.places)])
        self.visited += 1
        await self.driver.rest()
        return self.driver.feedback.event

    async def begun(self) -> Kept:
        """Begin an episode and drive in it; return it as it will have to be in the dataset."""
        episode = await self.driver.episodes.start(TASK)
        first = self.state.first_event
        last = await self.drive()
        return Kept(episode, "success", first, last, (Turn(self.name, "human", first + 1, last),), self.name)

    async def keep_one(self) -> None:
        episode = await self.begun()
        await self.driver.episodes.success()
        self.kept.append(episode)

    async def until(self, condition: Callable[[EpisodeState], bool], what: str) -> None:
        """Wait until the console says so."""
        try:
            async with asyncio.timeout(SECONDS):
                while not condition(self.state):
                    self.note_problems()
                    await asyncio.sleep(0.01)
        except TimeoutError:
            self.wrong.append(f"the console never said: {what}")

    def note_problems(self) -> None:
        for each in self.state.problems:
            text = f"{each.kind} {each.stream}".strip()
            if text not in self.said:
                self.said.append(text)


async def meet(run: FaultRun) -> None:
    """Let the run meet its fault, and note what the console says of it."""
    await _FAULTS[run.fault](run)


def settings_of(fault: FaultName | None) -> dict[str, str]:
    """Return the settings of a console that can meet the fault, LOCKSTEP_…; None: that meets none."""
    return {
        "LOCKSTEP_RECORDING__AUTOMATIC": "true",
        "LOCKSTEP_RECORDING__FREE_BYTES": str(LOW_BYTES if fault == "disk-low" else 0),
        "LOCKSTEP_EPISODES__COUNTDOWN_SECONDS": LONG_COUNTDOWN if fault == "kill-countdown" else "0",
    }


async def _kill_countdown(run: FaultRun) -> None:
    async def start() -> None:
        with suppress(ConsoleLost, EpisodeRefused):
            await run.driver.episodes.start(TASK)

    async with asyncio.TaskGroup() as tasks:
        tasks.create_task(start())
        await run.until(lambda state: state.phase == "countdown", "a count-down")
        await _kill(run)


async def _kill_open(run: FaultRun) -> None:
    await run.begun()
    if run.state.phase != "open":
        run.wrong.append(f"the console said {run.state.phase}, not open")
    await _kill(run)


async def _kill_keeping(run: FaultRun) -> None:
    second = await run.begun()

    async def keep() -> None:
        try:
            await run.driver.episodes.success()
            run.kept.append(second)  # it was said to be on the disk
        except (ConsoleLost, EpisodeRefused):
            run.perhaps.append(second)

    async with asyncio.TaskGroup() as tasks:
        tasks.create_task(keep())
        await run.until(lambda state: state.phase != "open", "that it keeps the episode")
        await _kill(run)


async def _kill_robot(run: FaultRun) -> None:
    """Kill the robot's bridge in an open episode."""
    await run.begun()
    await run.bridge.kill()
    await run.until(lambda state: state.phase == "idle", "the end of the episode")
    await _refuses_to_keep(run)


async def _kill_export(run: FaultRun) -> None:
    """Kill the export when its files begin to appear, and export again."""
    await run.keep_one()
    await run.console.end()
    root = run.folder / "dataset"
    files = sorted(map(str, (run.folder / "recordings").glob("*.mcap")))
    async with started((LOCKSTEP, "export", *files, "--to", "lerobot", "--out", str(root))) as exporting:
        async with asyncio.timeout(SECONDS):
            while not list(run.folder.glob(".dataset.partial-*/**/*.mp4")):
                if exporting.process.returncode is not None:
                    run.wrong.append("the export ended before it could be killed")
                    return
                await asyncio.sleep(0.005)
        await exporting.kill()
    run.said.append("export killed")
    if root.exists():
        run.wrong.append("a killed export has left a dataset")
    if list(run.folder.glob(".dataset.partial-*")):
        run.said.append("its unfinished files stay in a hidden folder, which the next export removes")


async def _disk(run: FaultRun) -> None:
    """Fill the disk while an episode is open."""
    await run.begun()
    ballast = run.folder / "recordings" / "ballast"
    free = shutil.disk_usage(ballast.parent).free
    left = LOW_BYTES + LOW_BYTES // 8 if run.fault == "disk-low" else 64 << 10
    with ballast.open("wb") as file:
        os.posix_fallocate(file.fileno(), 0, max(1, free - left))
    async with _driving_on(run):
        await run.until(lambda state: state.phase == "idle", "the end of the episode")
        await _refuses_to_keep(run)
    ballast.unlink()


async def _refuses_to_keep(run: FaultRun) -> None:
    run.said.append(run.state.last)
    if run.state.cut != 1 or "lost" not in run.state.last:
        run.wrong.append(f"the console said {run.state.last!r}, and {run.state.cut} lost")
    try:
        await run.driver.episodes.success()
        run.wrong.append("an episode was kept after it was lost")
    except EpisodeRefused:
        pass


@asynccontextmanager
async def _driving_on(run: FaultRun) -> AsyncIterator[None]:
    """Drive without end meanwhile."""

    async def drive() -> None:
        while True:
            await run.drive()

    async with asyncio.TaskGroup() as tasks:
        driving = tasks.create_task(drive())
        yield
        driving.cancel()


async def _camera_hangs(run: FaultRun) -> None:
    """One episode in the middle of which a camera hangs, and is kept all the same."""
    second = await run.begun()
    run.bridge.signal(signal.SIGUSR1)
    async with _driving_on(run):
        await run.until(
            lambda state: any(each.kind == "camera_missing" for each in state.problems), "a camera is missing"
        )
    run.note_problems()
    await run.driver.episodes.success()
    run.kept.append(second)


async def _kill(run: FaultRun) -> None:
    run.said.append(f"{run.state.phase}, {run.state.kept} kept")
    await run.console.kill()


_FAULTS: Final[Mapping[FaultName, Callable[[FaultRun], Awaitable[None]]]] = {
    "kill-countdown": _kill_countdown,
    "kill-open": _kill_open,
    "kill-keeping": _kill_keeping,
    "kill-robot": _kill_robot,
    "kill-export": _kill_export,
    "disk-low": _disk,
    "disk-full": _disk,
    "camera-hangs": _camera_hangs,
}
