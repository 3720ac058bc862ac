"""Answers each feedback of a console with the next command of a task, until the task is at its end."""

import asyncio
from collections import Counter
from collections.abc import Callable
from typing import Final, Protocol

from lockstep.client import CommandRefused, Console, NotArmed
from lockstep.protocol.messages import Feedback

__all__ = ["PASSING", "Task", "operate"]

# Refusals after which the next feedback is answered anew: a bad network or a busy machine has held somebody up.
PASSING: Final = ("late", "link_down", "not_neutral", "out_of_order", "rested")


class Task(Protocol):
    """A scripted operator. No I/O, no clock."""

    failed: str  # what went wrong; "" as long as nothing did

    @property
    def done(self) -> bool: ...

    def values(self, feedback: Feedback) -> list[float | None]:
        """Return the values of the command that answers this feedback."""


async def operate(
    console: Console,
    task: Task,
    held_up: Counter[str] | None = None,
    think: Callable[[Feedback], None] | None = None,
) -> int:
    """Drive until the task is done or has failed; return how often the robot had to be armed anew.

    Args:
        held_up: counts why
        think: computes what the next answer needs, in a thread: a client that computes falls silent, and loses the seat

    Raises:
        CommandRefused: for another reason than that somebody was held up.
        ConsoleLost: the connection ended.
    """
    feedback, armed = await _armed(console), 0
    while not task.done and not task.failed:
        if think is not None:
            await asyncio.to_thread(think, feedback)
        try:
            feedback = await console.drive(task.values(feedback))
        except (CommandRefused, NotArmed) as refused:
            if isinstance(refused, CommandRefused) and refused.reason not in PASSING:
                raise
            if held_up is not None:
                held_up[refused.reason if isinstance(refused, CommandRefused) else "not armed"] += 1
            feedback, armed = await _armed(console), armed + 1
    return armed


async def _armed(console: Console) -> Feedback:
    """Arm, again while the robot or its link is away: a simulated robot endangers no person."""
    while True:
        try:
            return await console.arm()
        except CommandRefused as refused:
            if refused.reason not in PASSING:
                raise
        await anext(aiter(console.feedbacks()))
