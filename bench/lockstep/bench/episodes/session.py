"""Two drivers who record episodes in turn: begin, drive, hand over, keep, discard, redo."""

import asyncio
import time
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass, field
from typing import Final

from lockstep.bench.episodes.dataset import Kept
from lockstep.bench.episodes.plan import DRIVERS, Planned
from lockstep.bench.episodes.visits import PLACES, Visit, places_near
from lockstep.bench.pick_place.operate import operate
from lockstep.client import Console
from lockstep.protocol.episodes import EpisodeOutcome
from lockstep.protocol.messages import Feedback

__all__ = ["Done", "Session", "drivers", "visit"]

CONNECT_SECONDS: Final = 60.0  # through a bad network, with a busy machine
SILENCE_SECONDS: Final = 15.0
EPISODE_SECONDS: Final = 180.0
TASK: Final = "visit two places"
VISITS: Final = 2  # of an episode


@dataclass
class Done:
    """What became of an episode, as its drivers saw it."""

    number: int
    fate: str
    drivers: list[str]
    seconds: float = 0.0
    armed: int = 0  # anew
    reached: int = 0  # places
    kept: Kept | None = None
    problems: list[str] = field(default_factory=list)  # that the console said of it


@asynccontextmanager
async def drivers(link: str, *, names: Sequence[str] = DRIVERS, pictures: bool = True) -> AsyncIterator[list[Console]]:
    """Connect a console for each driver; the first one gets the seat.

    A policy is one more of them, with a link of its own role, once the console has that role.
    """
    async with AsyncExitStack() as stack:
        consoles = [
            await stack.enter_async_context(
                Console(
                    link,
                    video=2 if pictures else False,
                    audio=False,
                    decode=False,
                    name=name,
                    connect_seconds=CONNECT_SECONDS,
                    silence_seconds=SILENCE_SECONDS,
                )
            )
            for name in names
        ]
        await consoles[0].take_seat()
        yield consoles


class Session:
    """Runs planned episodes with connected drivers, the first of whom holds the seat."""

    def __init__(self, consoles: Sequence[Console], say: Callable[[str], None]) -> None:
        self._consoles = consoles
        self._say = say
        self._holder = 0  # place of the driver who holds the seat
        self._visited = 0
        self._places: list[dict[str, float]] = []

    async def run(self, planned: Planned) -> Done:
        """Run one episode to its end. Raises ConsoleError, TimeoutError."""
        began = time.monotonic()
        done = Done(planned.number + 1, planned.fate, [DRIVERS[planned.driver]])
        async with asyncio.timeout(EPISODE_SECONDS):
            await self._hand_to(planned.driver)
            episodes = self._consoles[self._holder].episodes
            episode = await episodes.start(TASK)
            if planned.fate == "redo":
                await self._drive(done)
                episode = await self._consoles[self._holder].episodes.redo(episode)
            first = self._consoles[self._holder].episodes.state.first_event
            last = await self._drive(done)
            if planned.shared:
                await self._hand_to(1 - planned.driver)
                done.drivers.append(DRIVERS[self._holder])
                last = await self._drive(done)
            episodes = self._consoles[self._holder].episodes
            done.problems = [each.text for each in episodes.state.problems]
            if planned.fate == "discard":
                await episodes.discard(episode)
            else:
                outcome: EpisodeOutcome = "failure" if planned.fate == "failure" else "success"
                await episodes.keep(outcome, episode)
                done.kept = Kept(episode, outcome, first, last, frozenset(done.drivers))
        done.seconds = round(time.monotonic() - began, 1)
        self._say(
            f"{done.number}: {' and '.join(done.drivers)}, {done.fate}, {done.seconds:.1f} s, "
            f"{done.reached} places reached, armed anew {done.armed} times"
            + (f", {'; '.join(done.problems)}" if done.problems else "")
        )
        return done

    async def _hand_to(self, taker: int) -> None:
        """The holder of the seat grants it to the other, who asks for it."""
        if taker == self._holder:
            return
        giver, other = self._consoles[self._holder], self._consoles[taker]
        await giver.rest()
        async with asyncio.TaskGroup() as tasks:
            asking = tasks.create_task(other.request_seat())
            async for _ in giver.feedbacks():
                if any(claim.peer == other.peer for claim in giver.seat.claims):
                    break
                if asking.done():
                    break
            if not asking.done():
                giver.grant(other.peer)
        self._holder = taker

    async def _drive(self, done: Done) -> int:
        """Visit the next places; return the event of the last answer."""
        console = self._consoles[self._holder]
        for _ in range(VISITS):
            if not self._places:
                self._places = places_near(console.description, await _feedback(console))
            reached, armed = await visit(console, self._places[self._visited % len(PLACES)])
            done.reached += reached
            done.armed += armed
            self._visited += 1
        await console.rest()
        return 0 if console.feedback is None else console.feedback.event


async def visit(console: Console, goals: dict[str, float]) -> tuple[bool, int]:
    """Drive the tool to a place; return whether it got there, and how often the robot was armed anew."""
    task = Visit(console.description, goals)
    armed = await operate(console, task)
    return task.reached, armed


async def _feedback(console: Console) -> Feedback:
    return await anext(aiter(console.feedbacks())) if console.feedback is None else console.feedback
