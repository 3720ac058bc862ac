"""Drives a robot by a leader, for as long as the operator holds the key or the pedal."""

import asyncio
from collections.abc import Callable, Coroutine
from contextlib import suppress
from typing import Any

from lockstep.client.console import Console
from lockstep.client.control.clutch import Clutch
from lockstep.client.errors import CommandRefused, NotArmed
from lockstep.client.lead.hands import Hand
from lockstep.client.lead.leader import Newest
from lockstep.protocol.messages import Feedback

__all__ = ["lead"]

LOOK = 0.01  # s between two looks at the key or pedal


async def lead(
    console: Console,
    clutch: Clutch,
    newest: Newest,
    hand: Hand,
    say: Callable[[str], None],
) -> None:
    """Drive until the operator quits. Every press binds the leader anew, so that nothing leaps.

    Raises:
        ConsoleLost: the connection ended; the robot comes to rest by itself.
    """
    clock = asyncio.get_running_loop().time
    say(hand.words)
    while await _pressed(hand, clock):
        try:
            await _drive_on(console, clutch, newest, hand, say)
        except CommandRefused as error:
            say(f"{error}; let go, and press again")
        finally:
            clutch.release()
            await console.rest()


async def _drive_on(console: Console, clutch: Clutch, newest: Newest, hand: Hand, say: Callable[[str], None]) -> None:
    """Drive while the hand holds, and no longer.

    Raises:
        CommandRefused: the robot did not take a command.
    """
    clock = asyncio.get_running_loop().time
    with suppress(NotArmed):
        await console.arm()
    if not await _engaged(console, clutch, newest, hand, say):
        if hand.held(clock()):
            say("not engaged: the leader is not known, or the robot is not ready; let go, and press again")
        else:
            say("rests")
        return
    clipped: tuple[str, ...] = ()
    say("drives")
    while hand.held(clock()):
        values = clutch.values(newest.readings(clock()))
        if not clutch.engaged:
            break
        if clutch.clipped != clipped:
            clipped = clutch.clipped
            say(f"out of reach: {', '.join(clipped)}" if clipped else "drives")
        if await _answered(console.drive(values), hand, clock) is None:
            break
    say("rests" if not hand.held(clock()) else "rests: the clutch was released; let go, and press again")


async def _engaged(console: Console, clutch: Clutch, newest: Newest, hand: Hand, say: Callable[[str], None]) -> bool:
    """Engage, as soon as the robot stands still: a press may come soon after the one before."""
    clock = asyncio.get_running_loop().time
    said = False
    while not clutch.engage(newest.readings(clock())):
        if not clutch.waits:
            return False
        if not said:
            said = True
            say("waits until the robot stands still")
        if await _answered(console.drive({}), hand, clock) is None:
            return False
    return True


async def _answered(drive: Coroutine[Any, Any, Feedback], hand: Hand, clock: Callable[[], float]) -> Feedback | None:
    """Return the answer to a command; None if the operator has let go meanwhile, which waits for nothing."""
    failed: list[Exception] = []
    answers: list[Feedback] = []

    async def command() -> None:
        try:
            answers.append(await drive)
        except Exception as error:  # raised below, as the only one
            failed.append(error)

    async with asyncio.TaskGroup() as tasks:
        driving = tasks.create_task(command(), name="command")
        while not driving.done():
            await asyncio.wait([driving], timeout=LOOK)
            if not hand.held(clock()):
                driving.cancel()
                break
    for error in failed:
        raise error
    return answers[0] if answers and hand.held(clock()) else None


async def _pressed(hand: Hand, clock: Callable[[], float]) -> bool:
    """Wait for a new press; return False when the operator quits. A key that was held all along is not a new press."""
    for wanted in (False, True):
        while hand.held(clock()) != wanted and not hand.quit.is_set():
            with suppress(TimeoutError):
                async with asyncio.timeout(LOOK):
                    await hand.quit.wait()
    return not hand.quit.is_set()
