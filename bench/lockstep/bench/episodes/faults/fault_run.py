"""What a fault needs: the parts of a run, and what it finds."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, Literal, get_args

from lockstep.bench.episodes.dataset import Kept
from lockstep.bench.episodes.session import visit
from lockstep.bench.episodes.turns import Turn
from lockstep.bench.episodes.visits import places_near
from lockstep.bench.harness.processes import Running
from lockstep.bench.harness.stack import LOCKSTEP
from lockstep.client import ActionCancelled, ActionRefused, Console, ConsoleLost, EpisodeRefused
from lockstep.protocol.episodes import EpisodeState

__all__ = ["ALONE", "DISK_FAULTS", "FAULTS", "RESET", "ROBOT", "SECONDS", "TASK", "FaultName", "FaultRun", "following"]

FaultName = Literal[
    "kill-countdown",
    "kill-open",
    "kill-keeping",
    "kill-reset",
    "kill-robot",
    "kill-robot-keeping",
    "kill-robot-reset",
    "kill-policy",
    "kill-export",
    "discard-late",
    "disk-low",
    "disk-full",
    "camera-hangs",
]
FAULTS: Final[tuple[FaultName, ...]] = get_args(FaultName)
ALONE: Final = ("kill-reset", "kill-robot-reset")  # not among planned episodes, whose drivers drive no reset
DISK_FAULTS: Final = ("disk-low", "disk-full")

ROBOT: Final = "lockstep.bench.episodes.hanging_camera:HangingCameraArm"
TASK: Final = "visit a place"
RESET: Final = "home"  # the action of the arm that is run between episodes
SECONDS: Final = 60.0  # for anything that is waited for


def following(folder: Path) -> tuple[str, ...]:
    """Return the command that appends each kept episode while others are driven."""
    where = ("--out", str(folder / "live"), "--dir", str(folder / "recordings"), "--state-dir", str(folder))
    return (LOCKSTEP, "export", "--to", "lerobot", "--follow", *where)


@dataclass
class FaultRun:
    """The parts of one run, and what it finds.

    Attributes:
        link: an operator's, past the network
        policy_link: of a policy that is not connected
    """

    fault: FaultName
    folder: Path
    bridge: Running
    console: Running
    driver: Console
    link: str
    policy_link: str
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

    @property
    def event(self) -> int:
        """The newest event that the driver knows."""
        return 0 if self.driver.feedback is None else self.driver.feedback.event

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

    async def go_home(self) -> None:
        """Do the reset action if the console waits for it, until it is done or something ends it."""
        if not self.state.reset_action:
            return
        await self.until(lambda state: state.phase == "resetting", "that the robot has to go home")
        with suppress(ConsoleLost, ActionRefused, ActionCancelled):
            await self.driver.arm()
            await self.driver.act(RESET)

    async def until_it_moves(self) -> None:
        """Wait until the reset action runs and the robot moves."""
        try:
            async with asyncio.timeout(SECONDS):
                async for feedback in self.driver.feedbacks():
                    if not feedback.at_rest and any(each.state == "running" for each in self.driver.actions):
                        return
        except TimeoutError:
            self.wrong.append("the robot never went home")

    async def keep(self, episode: Kept) -> None:
        """Keep an open episode: it has to be in the dataset if the console says so, and may be if it says nothing."""
        try:
            await self.driver.episodes.success()
            self.kept.append(episode)
        except EpisodeRefused as refused:
            self.said.append(f"refused: {refused}")
        except ConsoleLost:
            self.perhaps.append(episode)

    async def refuses_to_keep(self) -> None:
        """Check that the console has said that the episode is lost, and keeps it no more."""
        self.said.append(self.state.last)
        if self.state.cut != 1 or "lost" not in self.state.last:
            self.wrong.append(f"the console said {self.state.last!r}, and {self.state.cut} lost")
        try:
            await self.driver.episodes.success()
            self.wrong.append("an episode was kept after it was lost")
        except EpisodeRefused:
            pass

    @asynccontextmanager
    async def driving_on(self) -> AsyncIterator[None]:
        """Drive without end meanwhile."""

        async def drive() -> None:
            while True:
                await self.drive()

        async with asyncio.TaskGroup() as tasks:
            driving = tasks.create_task(drive())
            yield
            driving.cancel()

    async def kill_console(self) -> None:
        self.said.append(f"{self.state.phase}, {self.state.kept} kept")
        await self.console.kill()

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
