"""Faults in each phase of an episode: a killed console or robot, a full disk, a camera that hangs.

Each has parts of its own. It keeps a first episode, so that there is a dataset, then meets its fault in or after the
second one. The dataset is made afterwards, and must have the kept episodes alone, whole.
"""

import asyncio
import os
import secrets
import shutil
import signal
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal, get_args

from lockstep.bench.episodes.dataset import Kept, export, judged
from lockstep.bench.episodes.session import drivers, visit
from lockstep.bench.episodes.small_disk import small_disk
from lockstep.bench.episodes.turns import Turn
from lockstep.bench.episodes.visits import places_near
from lockstep.bench.harness.processes import Running, started
from lockstep.bench.harness.stack import LOCKSTEP, Bridge, running_bridge, running_console
from lockstep.client import Console, ConsoleLost, EpisodeRefused
from lockstep.protocol.episodes import EpisodeState

__all__ = ["FAULTS", "FaultName", "run_fault"]

FaultName = Literal[
    "kill-countdown", "kill-open", "kill-keeping", "kill-robot", "kill-export", "disk-low", "disk-full", "camera-hangs"
]
FAULTS: Final[tuple[FaultName, ...]] = get_args(FaultName)

ROBOT: Final = "so101"
HANGING: Final = "lockstep.bench.episodes.hanging_camera:HangingCameraArm"
TASK: Final = "visit a place"
COUNTDOWN: Final = {"LOCKSTEP_EPISODES__COUNTDOWN_SECONDS": "4"}
NO_COUNTDOWN: Final = {"LOCKSTEP_EPISODES__COUNTDOWN_SECONDS": "0"}
SECONDS: Final = 60.0  # for anything that is waited for
REST_SECONDS: Final = 5.0
DISK_BYTES: Final = 64 << 20  # of the small disk
LOW_BYTES: Final = 8 << 20  # that are to stay free on it


@dataclass
class _Run:
    """The parts of one run, and what it finds."""

    fault: FaultName
    folder: Path
    bridge: Bridge
    console: Running
    driver: Console
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
        return Kept(episode, "success", first, last, (Turn("Ada", "human", first + 1, last),), "Ada")

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


async def run_fault(fault: FaultName, say: Callable[[str], None]) -> dict[str, Any]:
    """Try one fault; `ok` in the answer says whether the dataset is right and the console said so at the time.

    Raises:
        ProcessFailed, ConsoleError, TimeoutError: a part did not start, or was lost before the fault.
    """
    task = asyncio.current_task()
    if task is not None:  # a terminated run leaves no mounted disk either
        asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, task.cancel)
    async with _running(fault) as run:
        await run.keep_one()
        await _FAULTS[fault](run)
        with suppress(ConsoleLost, TimeoutError):
            async with asyncio.timeout(REST_SECONDS):  # a robot that was killed proves no rest
                await run.driver.rest()
        recordings = run.folder / "recordings"
        root = run.folder / "dataset"
        await run.console.end()  # a console that still lives ends its recording
        if not root.exists():
            said = await export(sorted(recordings.glob("*.mcap")), root)
            run.wrong += [f"export: {said}"] if said else []
        found: dict[str, Any] = await judged(root, run.kept) if root.exists() else {}
        if found.get("wrong") and run.perhaps:
            found = await judged(root, [*run.kept, *run.perhaps])
        run.wrong += found.get("wrong", [])
        halves = [each.name for each in run.folder.glob("**/meta/info.json") if each.parent.parent != root]
        run.wrong += [f"a half-written dataset at {each}" for each in halves]
    figures = {
        "fault": fault,
        "said": run.said,
        "kept": len(run.kept),
        "in_dataset": len(found.get("rows", [])),
        "rows": found.get("rows", []),
        "left_out": found.get("left_out", []),
        "wrong": run.wrong,
        "ok": not run.wrong,
    }
    say(f"{fault}: {'right' if not run.wrong else '; '.join(run.wrong)}; the console said: {'; '.join(run.said)}")
    return figures


@asynccontextmanager
async def _running(fault: FaultName) -> AsyncIterator[_Run]:
    """Start bridge, console and driver, with a recording that runs from the start."""
    async with AsyncExitStack() as stack:
        bridge = await stack.enter_async_context(running_bridge(HANGING if fault == "camera-hangs" else ROBOT))
        folder = bridge.event_log.parent
        if fault in ("disk-low", "disk-full"):
            (folder / "recordings").mkdir()
            stack.enter_context(small_disk(folder / "recordings", DISK_BYTES))
        settings = {
            "LOCKSTEP_STATE_DIR": str(folder),
            "LOCKSTEP_SECRET": secrets.token_urlsafe(32),
            "LOCKSTEP_SCENE": "false",
            "LOCKSTEP_RECORDING__AUTOMATIC": "true",
            "LOCKSTEP_RECORDING__FREE_BYTES": str(LOW_BYTES if fault == "disk-low" else 0),
            **(COUNTDOWN if fault == "kill-countdown" else NO_COUNTDOWN),
        }
        console, links = await stack.enter_async_context(running_console(bridge.address, environment=settings))
        [driver] = await stack.enter_async_context(drivers([("Ada", links["operator"])], pictures=False))
        yield _Run(fault, folder, bridge, console, driver)


async def _kill_countdown(run: _Run) -> None:
    async def start() -> None:
        with suppress(ConsoleLost, EpisodeRefused):
            await run.driver.episodes.start(TASK)

    async with asyncio.TaskGroup() as tasks:
        tasks.create_task(start())
        await run.until(lambda state: state.phase == "countdown", "a count-down")
        await _kill(run)


async def _kill_open(run: _Run) -> None:
    await run.begun()
    if run.state.phase != "open":
        run.wrong.append(f"the console said {run.state.phase}, not open")
    await _kill(run)


async def _kill_keeping(run: _Run) -> None:
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


async def _kill_robot(run: _Run) -> None:
    """Kill the robot's bridge in an open episode."""
    await run.begun()
    await run.bridge.process.kill()
    await run.until(lambda state: state.phase == "idle", "the end of the episode")
    await _refuses_to_keep(run)


async def _kill_export(run: _Run) -> None:
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


async def _disk(run: _Run) -> None:
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


async def _refuses_to_keep(run: _Run) -> None:
    run.said.append(run.state.last)
    if run.state.cut != 1 or "lost" not in run.state.last:
        run.wrong.append(f"the console said {run.state.last!r}, and {run.state.cut} lost")
    try:
        await run.driver.episodes.success()
        run.wrong.append("an episode was kept after it was lost")
    except EpisodeRefused:
        pass


@asynccontextmanager
async def _driving_on(run: _Run) -> AsyncIterator[None]:
    """Drive without end meanwhile."""

    async def drive() -> None:
        while True:
            await run.drive()

    async with asyncio.TaskGroup() as tasks:
        driving = tasks.create_task(drive())
        yield
        driving.cancel()


async def _camera_hangs(run: _Run) -> None:
    """One episode in the middle of which a camera hangs, and is kept all the same."""
    second = await run.begun()
    run.bridge.process.signal(signal.SIGUSR1)
    async with _driving_on(run):
        await run.until(
            lambda state: any(each.kind == "camera_missing" for each in state.problems), "a camera is missing"
        )
    run.note_problems()
    await run.driver.episodes.success()
    run.kept.append(second)


async def _kill(run: _Run) -> None:
    run.said.append(f"{run.state.phase}, {run.state.kept} kept")
    await run.console.kill()


_FAULTS: Final[Mapping[FaultName, Callable[[_Run], Awaitable[None]]]] = {
    "kill-countdown": _kill_countdown,
    "kill-open": _kill_open,
    "kill-keeping": _kill_keeping,
    "kill-robot": _kill_robot,
    "kill-export": _kill_export,
    "disk-low": _disk,
    "disk-full": _disk,
    "camera-hangs": _camera_hangs,
}
