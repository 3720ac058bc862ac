"""Drives events one by one: sent, executed by the robot, answered."""

import asyncio
import math
import random
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import NamedTuple

from lockstep.client import Console, NotArmed
from lockstep.protocol.description import Axis, RobotDescription
from lockstep.protocol.messages import Command, Feedback, Refusal
from lockstep.protocol.neutral import neutral_values
from lockstep.protocol.serial import event_after
from lockstep.robot_bridge.link.link_client import RobotLink

__all__ = [
    "Pause",
    "Trip",
    "applied_goals",
    "axis_values",
    "console_trips",
    "drive_on",
    "link_trips",
    "round_and_round",
]

SPEEDS = {"base.vx": 0.15, "base.wz": 0.6, "tool.vz": 0.03}  # the base drives a circle of 0.25 m; the tool nods
TICK = 0.004  # s, the robot's control tick
RATE = 25.0  # events a second at most; above, the gate may also wait for pictures
TIMER = 0.0015  # s, accuracy of a sleep
ARMINGS = 20  # attempts in a row to arm a robot that a busy machine holds up
MARGIN = 0.0005  # s on top of the shortest interval between two events


class Trip(NamedTuple):
    """One event as the operator's side saw it."""

    event: int
    sent: float  # s, monotonic
    answered: float

    @property
    def seconds(self) -> float:
        return self.answered - self.sent


def applied_goals(console: Console) -> Sequence[float | None]:
    """Return the applied goals of the newest feedback; empty before the first, and for a robot without goal axes."""
    return () if console.feedback is None else console.feedback.goals


def axis_values(axes: Sequence[Axis], speeds: Mapping[int, float]) -> list[float | None]:
    """Return `speeds` by the axes' numbers, -1 for the last. The others move nothing, nor do goal axes: a number there
    would be a place."""
    values = neutral_values(axes)
    for number, speed in speeds.items():
        if axes[number].kind == "rate":
            values[number] = speed
    return values


def round_and_round(description: RobotDescription) -> Callable[[float], list[float | None]]:
    """Return a function from a time to the values of each axis; a robot that follows them stays where it is.

    Rate axes without a speed of their own get 0, goal axes stay.
    """

    def values(now: float) -> list[float | None]:
        nod = math.cos(now)
        found = {"base.vx": 1.0, "base.wz": 1.0, "tool.vz": nod}
        return [
            None if axis.kind == "goal" else SPEEDS.get(axis.name, 0.0) * found.get(axis.name, 0.0)
            for axis in description.axes
        ]

    return values


class Pause:
    """The pause between two commands: the interval of the event rate, and up to a tick more.

    Without the addition all commands would meet the control tick at the same phase. The end of the pause is not slept:
    timers keep to the clock's milliseconds, on which the ticks lie too, and a tenth of a millisecond in the path would
    then decide whether every command waits a quarter of a tick less or more.
    """

    def __init__(self, description: RobotDescription, seed: int) -> None:
        self._interval = 1 / min(RATE, description.max_event_rate) + MARGIN
        self._spread = random.Random(seed)

    async def after(self, sent: float) -> None:
        until = sent + self._interval + self._spread.random() * TICK
        await asyncio.sleep(max(0.0, until - TIMER - time.monotonic()))
        while time.monotonic() < until:
            pass


async def drive_on(console: Console, values: Mapping[str, float | None] | Sequence[float | None]) -> Feedback:
    """Drive, and arm first whenever the robot asks for it: a simulated robot endangers no person.

    A busy machine may hold the robot up again between the two, or while it is being armed.

    Raises:
        NotArmed: the robot asked for it every time.
        CommandRefused: the robot is stopped, this console does not hold the seat, …
        ConsoleLost: the connection ended.
    """
    for _ in range(ARMINGS):
        try:
            return await console.drive(values)
        except NotArmed:
            with suppress(NotArmed):
                await console.arm()
    return await console.drive(values)


async def console_trips(console: Console, count: int, *, seconds: float = 60.0, seed: int = 1) -> list[Trip]:
    """Drive `count` events, or for `seconds`, as fast as `RATE` and the robot's highest event rate allow.

    Each command is asked for only when the gate is open, so that waiting for the event rate is no part of the trip: it
    is sent by the call itself. The first command, which may meet a gate that is still shut, is not counted; nor is one
    before which the robot wants a neutral command because a busy machine has held it up.
    """
    values, pause = round_and_round(console.description), Pause(console.description, seed)
    await drive_on(console, values(time.monotonic()))
    await pause.after(time.monotonic())
    trips: list[Trip] = []
    end = time.monotonic() + seconds
    while len(trips) < count and time.monotonic() < end:
        sent = time.monotonic()
        try:
            feedback = await console.drive(values(sent))
            trips.append(Trip(feedback.event, sent, time.monotonic()))
        except NotArmed:
            await drive_on(console, values(time.monotonic()))
        await pause.after(sent)
    return trips


async def link_trips(link: RobotLink, description: RobotDescription, count: int, *, seed: int = 1) -> list[Trip]:
    """Drive the same straight to the bridge, without a console between.

    A busy machine may hold the robot up for so long that it wants a neutral command first; that is not counted.
    """
    values, pause = round_and_round(description), Pause(description, seed)
    rest = neutral_values(description.axes)
    newest = await _feedback_of(link)
    trips: list[Trip] = []
    while len(trips) < count:
        sent = time.monotonic()
        event = event_after(newest.event)
        moves = values(sent) if trips and not newest.neutral_needed else rest
        link.send(Command(event=event, issue=newest.issue, values=moves, nonce=newest.nonce))
        answer = await _answer_to(link, event)
        if isinstance(answer, Feedback):
            trips.append(Trip(event, sent, time.monotonic()))
            newest = answer
        else:
            newest = await _feedback_of(link)
        await pause.after(sent)
    return trips


async def _answer_to(link: RobotLink, event: int) -> Feedback | Refusal:
    async for message in link:
        if isinstance(message, Feedback | Refusal) and message.event == event:
            return message
    raise RuntimeError("the robot link was closed")


async def _feedback_of(link: RobotLink) -> Feedback:
    async for message in link:
        if isinstance(message, Feedback):
            return message
    raise RuntimeError("the robot link was closed")
