"""Two people and a policy who record episodes in turn: begin, drive, hand over, take over, keep, discard, redo."""

import asyncio
import time
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass, field
from typing import Final

from lockstep.bench.episodes.dataset import Kept
from lockstep.bench.episodes.plan import DRIVERS, POLICY, Planned
from lockstep.bench.episodes.policy_turn import PolicyTurn, attend, take_over
from lockstep.bench.episodes.turns import Turn, is_intervention
from lockstep.bench.episodes.visits import PLACES, Visit, places_near
from lockstep.bench.pick_place.hands import PolicyHand
from lockstep.bench.pick_place.operate import operate
from lockstep.client import Console
from lockstep.protocol.episodes import EpisodeOutcome
from lockstep.protocol.messages import Feedback

__all__ = ["Done", "Session", "drivers", "visit"]

CONNECT_SECONDS: Final = 60.0  # through a bad network, with a busy machine
SILENCE_SECONDS: Final = 15.0
EPISODE_SECONDS: Final = 300.0
TASK: Final = "visit two places"
VISITS: Final = 2  # of a turn
TAKEN_AFTER: Final = 8  # events of the policy


@dataclass
class Done:
    """What became of an episode, as its drivers saw it."""

    number: int
    fate: str
    drivers: list[str]
    seconds: float = 0.0
    armed: int = 0  # anew
    reached: int = 0  # places
    offers: int = 0  # of the seat, to the policy
    corrections: int = 0  # turns of a person after one of the policy
    kept: Kept | None = None
    problems: list[str] = field(default_factory=list)  # that the console said of it


@asynccontextmanager
async def drivers(links: Sequence[tuple[str, str]], *, pictures: bool = True) -> AsyncIterator[list[Console]]:
    """Connect a console for each driver, given by name and link; the first one gets the seat."""
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
            for name, link in links
        ]
        await consoles[0].take_seat()
        yield consoles


class Session:
    """Runs planned episodes with the connected DRIVERS, the first of whom holds the seat."""

    def __init__(self, consoles: Sequence[Console], say: Callable[[str], None]) -> None:
        self._consoles = consoles
        self._say = say
        self._holder = 0  # place of the driver who holds the seat
        self._person = 0  # place of the person who holds the seat, or lets the policy drive
        self._visited = 0
        self._places: list[dict[str, float]] = []

    async def run(self, planned: Planned) -> Done:
        """Run one episode to its end. Raises ConsoleError, TimeoutError."""
        began = time.monotonic()
        done = Done(planned.number + 1, planned.fate, [DRIVERS[each] for each in planned.turns])
        async with asyncio.timeout(EPISODE_SECONDS):
            await self._begin(planned)
            episode = await self._asks().episodes.start(TASK)
            if planned.fate == "redo":
                await self._turn(planned.turns[0], None, done)
                episode = await self._asks().episodes.redo(episode)
            first = self._asks().episodes.state.first_event
            turns = [
                await self._turn(driver, taker, done)
                for driver, taker in zip(planned.turns, (*planned.turns[1:], None), strict=True)
            ]
            done.corrections = sum(is_intervention(turns, number) for number in range(len(turns)))
            done.problems = [each.text for each in self._asks().episodes.state.problems]
            if planned.fate == "discard":
                await self._asks().episodes.discard(episode)
            else:
                outcome: EpisodeOutcome = "failure" if planned.fate == "failure" else "success"
                await self._asks().episodes.keep(outcome, episode)
                last = turns[-1].last_event
                done.kept = Kept(episode, outcome, first, last, tuple(turns), DRIVERS[planned.person])
        done.seconds = round(time.monotonic() - began, 1)
        self._say(_line(done))
        return done

    async def person(self) -> Console:
        """Return the console of a person who holds the seat; who else held it is at rest."""
        if self._holder == POLICY:
            await self._take_over(self._person)
        return self._asks()

    def _asks(self) -> Console:
        """Return the console of the person who may say what becomes of the episode."""
        return self._consoles[self._person]

    async def _begin(self, planned: Planned) -> None:
        """Give the seat to the person who begins, and let that person do nothing if the policy drives first."""
        if self._holder == POLICY:
            await self._take_over(planned.person)
        await self._hand_to(planned.person)
        if planned.turns[0] == POLICY:
            await self._asks().rest()

    async def _hand_to(self, taker: int) -> None:
        """The person who holds the seat grants it to the other, who asks for it."""
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
        self._holder = self._person = taker

    async def _take_over(self, taker: int) -> None:
        await take_over(self._consoles[taker])
        self._holder = self._person = taker

    async def _turn(self, driver: int, taker: int | None, done: Done) -> Turn:
        """`taker`: drives next; None: nobody."""
        if driver == POLICY:
            return await self._policy_turn(taker, done)
        if self._holder != driver:
            await self._hand_to(driver)
        return await self._human_turn(done)

    async def _human_turn(self, done: Done) -> Turn:
        """Visit the next places."""
        console = self._consoles[self._holder]
        first = 0
        for _ in range(VISITS):
            await self._know_places()
            task = self._next_visit()
            done.armed += await operate(console, task)
            done.reached += task.reached
            first = first or task.first_event
        await console.rest()
        return Turn(DRIVERS[self._holder], "human", first, 0 if console.feedback is None else console.feedback.event)

    async def _policy_turn(self, taker: int | None, done: Done) -> Turn:
        """Let the policy visit places, until the taker takes over or, without one, as many as in any turn."""
        await self._know_places()
        policy, person = self._consoles[POLICY], self._asks()
        hand = PolicyHand(policy.description)
        turn = PolicyTurn(policy, lambda: self._next_visit(hand), VISITS if taker is None else None)
        if self._holder != POLICY:
            await person.rest()
        async with asyncio.TaskGroup() as tasks:
            driving = tasks.create_task(turn.drive())
            attending = tasks.create_task(attend(person, policy.peer, turn))
            if taker is not None:
                async for _ in self._consoles[taker].feedbacks():
                    if turn.answered >= TAKEN_AFTER and not turn.is_waiting:
                        break
                turn.is_taken = True
                attending.cancel()
                await self._take_over(taker)
                if turn.is_waiting:
                    driving.cancel()
            await asyncio.wait([driving])
            attending.cancel()
        if taker is None:
            self._holder = POLICY
        done.offers += turn.offers
        done.reached += sum(each.reached for each in turn.visits)
        return turn.noted(DRIVERS[POLICY])

    async def _know_places(self) -> None:
        if not self._places:
            console = self._asks()
            self._places = places_near(console.description, await _feedback(console))

    def _next_visit(self, hand: PolicyHand | None = None) -> Visit:
        self._visited += 1
        return Visit(self._asks().description, self._places[self._visited % len(PLACES)], hand)


def _line(done: Done) -> str:
    return (
        f"{done.number}: {', '.join(done.drivers)}, {done.fate}, {done.seconds:.1f} s, {done.reached} places reached, "
        f"armed anew {done.armed} times, {done.corrections} corrections"
        + (f", {'; '.join(done.problems)}" if done.problems else "")
    )


async def visit(console: Console, goals: dict[str, float]) -> tuple[bool, int]:
    """Drive the tool to a place; return whether it got there, and how often the robot was armed anew."""
    task = Visit(console.description, goals)
    armed = await operate(console, task)
    return task.reached, armed


async def _feedback(console: Console) -> Feedback:
    return await anext(aiter(console.feedbacks())) if console.feedback is None else console.feedback
