"""A policy that visits places in the seat that a person offers, and the person who offers it."""

from collections.abc import Callable
from typing import Final

from lockstep.bench.episodes.turns import Turn
from lockstep.bench.episodes.visits import Visit
from lockstep.bench.pick_place.operate import PASSING
from lockstep.client import CommandRefused, Console, ConsoleLost, SeatRefused

__all__ = ["PolicyTurn", "attend", "take_over"]

ENDS: Final[tuple[str, ...]] = ("no_seat", *PASSING)  # refusals that end the policy's turn in the seat


class PolicyTurn:
    """The policy's part of an episode. After a refusal it releases the seat, and waits until a person offers it again.

    Attributes:
        is_taken: set before a person takes over: the next refusal ends it
        is_waiting: for an offer; it has sent nothing that is not answered
        visits: that it has begun
        offers: of the seat to it
    """

    def __init__(self, console: Console, next_visit: Callable[[], Visit], times: int | None) -> None:
        """`times`: how many places; None: until a person takes over."""
        self._console = console
        self._next_visit = next_visit
        self._times = times
        self.is_taken = False
        self.is_waiting = True
        self.visits: list[Visit] = []
        self.offers = 0

    @property
    def answered(self) -> int:
        """Its commands that were answered."""
        return sum(each.answered for each in self.visits)

    def noted(self, name: str) -> Turn:
        driven = [each for each in self.visits if each.answered]
        return Turn(name, "policy", driven[0].first_event, driven[-1].last_event)

    async def drive(self) -> None:
        """Return when it has visited its places, at rest in the seat, or when a person has taken over.

        Raises:
            CommandRefused: for another reason than that somebody was held up.
        """
        console = self._console
        while True:
            self.is_waiting = True
            await console.policies.seat()
            self.is_waiting = False
            try:
                if not self._is_done():
                    await self._visit_all()
                    await console.rest()
                if console.seat.holder == console.peer:
                    return
            except CommandRefused as refused:
                if refused.reason not in ENDS:
                    raise
                if self.is_taken:
                    return
            await self._leave()

    async def _visit_all(self) -> None:
        feedback = await self._console.arm()
        while not self._is_done():
            if not self.visits or self.visits[-1].done:
                self.visits.append(self._next_visit())
            feedback = await self._console.drive(self.visits[-1].values(feedback))

    def _is_done(self) -> bool:
        done = sum(each.done for each in self.visits)
        return self._times is not None and done >= self._times

    async def _leave(self) -> None:
        """Release the seat, so that a person looks before it drives again."""
        self._console.release_seat()
        async for _ in self._console.feedbacks():
            if self._console.seat.holder != self._console.peer:
                return


async def attend(person: Console, policy: str, turn: PolicyTurn) -> None:
    """Offer the seat to the policy, a peer, again whenever its turn in it has ended; until cancelled."""
    while True:
        seat = person.seat
        if not (turn.is_taken or seat.offered or seat.holder not in ("", person.peer)):
            try:
                await person.policies.offer(policy)
                turn.offers += 1
                continue
            except (SeatRefused, ConsoleLost):
                pass  # while the robot's link is away, or the answer is: it is asked for again
        await anext(aiter(person.feedbacks()))


async def take_over(person: Console) -> None:
    """Take the seat from the policy; again while the answer is lost in a bad network.

    Raises:
        ConsoleLost: the connection ended.
    """
    while True:
        try:
            await person.take_over()
        except ConsoleLost:
            await anext(aiter(person.feedbacks()))
        else:
            return
