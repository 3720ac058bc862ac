"""The futures of callers that wait for a command's answer, or for a rest to be proven."""

import asyncio
from collections import deque
from collections.abc import Iterable
from typing import Any

from lockstep.client.control.command_sender import Outcome
from lockstep.client.errors import CommandRefused, ConsoleLost, NotArmed
from lockstep.protocol.messages import Feedback, Refusal

__all__ = ["Waiters"]


class Waiters:
    """Call `settle` with the sender's outcomes, `rested` while no rest is under way, and `end` with the connection.

    Attributes:
        lost: why the connection ended; None while it lasts
    """

    def __init__(self) -> None:
        self.lost: ConsoleLost | None = None
        self._loop = asyncio.get_running_loop()
        self._answers: deque[tuple[int, asyncio.Future[Feedback]]] = deque()  # by ticket, the oldest first
        self._rests: list[asyncio.Future[None]] = []

    def check(self) -> None:
        """Raise ConsoleLost if the connection has ended."""
        if self.lost is not None:
            raise self.lost

    def answer(self, ticket: int) -> asyncio.Future[Feedback]:
        """Return a future of the outcome of the intention with this ticket."""
        answered: asyncio.Future[Feedback] = self._loop.create_future()
        self._answers.append((ticket, answered))
        return answered

    def rest(self) -> asyncio.Future[None]:
        """Return a future of the proof of a rest."""
        rested: asyncio.Future[None] = self._loop.create_future()
        self._rests.append(rested)
        return rested

    def settle(self, outcomes: Iterable[Outcome]) -> None:
        """Tell the outcomes to those that wait for them."""
        for outcome in outcomes:
            while self._answers and self._answers[0][0] <= outcome.ticket:
                _, waiting = self._answers.popleft()
                if waiting.done():
                    continue
                if outcome.feedback is not None:
                    waiting.set_result(outcome.feedback)
                elif outcome.refusal is not None:
                    waiting.set_exception(_error(outcome.refusal))

    def rested(self) -> None:
        """Tell that the robot is proven to be at rest."""
        for rested in self._rests:
            if not rested.done():
                rested.set_result(None)
        self._rests.clear()

    def end(self, lost: ConsoleLost) -> None:
        """End every wait: the connection ended."""
        self.lost = lost
        pending: list[asyncio.Future[Any]] = [*(future for _, future in self._answers), *self._rests]
        self._answers.clear()
        self._rests.clear()
        for future in pending:
            if not future.done():
                future.set_exception(lost)


def _error(refusal: Refusal) -> CommandRefused:
    return NotArmed() if refusal.reason == "not_neutral" else CommandRefused(refusal.reason, refusal.detail)
