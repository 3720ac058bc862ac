"""A robot of the tests, and not Lockstep's bridge: a small simulated arm with goal axes behind a real TCP link.

It keeps the rules of docs/robot-link.md, "Goal axes", but for acceleration: an applied goal moves at its speed at once.
"""

import math
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field

import msgspec

from lockstep.protocol.description import Axis, Camera, RobotDescription
from lockstep.protocol.neutral import neutral_values
from lockstep.protocol.serial import event_after, event_gap
from tests.robot_bridge.conformance.plain_bridge import AGE, TICK, PlainBridge, serving
from tests.robot_bridge.conformance.plain_messages import Message

__all__ = ["ARM", "HOLD", "SAG", "GoalRobot", "running_goal_robot"]

HOLD = 0.3  # s
SAG = 0.01  # rad by which the joints hang lower than where they are told to be
ARM = RobotDescription(
    name="goal-arm",
    label="Arm of the tests",
    axes=(
        Axis(name="base", label="Base", unit="m/s", minimum=-1, maximum=1, slew=10, brake=20),
        Axis(name="j1", label="J1", unit="rad", minimum=-2, maximum=2, slew=2, brake=20, kind="goal", reach=0.4),
        Axis(
            name="j2",
            label="J2",
            unit="rad",
            minimum=-math.pi,
            maximum=math.pi,
            slew=2,
            brake=20,
            kind="goal",
            reach=0.4,
            wrap=2 * math.pi,
        ),
    ),
    cameras=(Camera(name="camera", label="Camera", width=16, height=16, frame_rate=25),),
    hold=HOLD,
    max_event_age=AGE,
    max_event_rate=50,
)


@dataclass(eq=False)
class GoalRobot(PlainBridge):
    """Attributes besides those of the bridge:

    executed_values: of all executed commands
    blocked: measured values that something holds where they are, by the number of the axis
    """

    description: Message = field(default_factory=lambda: dict(msgspec.to_builtins(ARM)))
    wanted: list[float | None] = field(default_factory=lambda: neutral_values(ARM.axes))
    speed: float = 1.0
    applied: list[float] = field(default_factory=lambda: [0.0, 0.5, 3.0])
    blocked: dict[int, float] = field(default_factory=dict)
    executed_values: list[list[float | None]] = field(default_factory=list)
    rests: int = 0

    def tick(self) -> None:
        if time.monotonic() - self.executed > HOLD - TICK:
            self.wanted = neutral_values(ARM.axes)
        for index, axis in enumerate(ARM.axes):
            wanted = self.wanted[index]
            if axis.kind == "goal" and wanted is not None:
                step = self.speed * axis.slew * TICK
                moved = self.applied[index] + min(max(distance(axis, self.applied[index], wanted), -step), step)
                self.applied[index] = moved if axis.wrap is None else math.remainder(moved, axis.wrap)
        super().tick()

    @property
    def goals(self) -> list[float | None]:
        goals = zip(self.applied, ARM.axes, strict=True)
        return [goal if axis.kind == "goal" else None for goal, axis in goals]

    @property
    def places(self) -> list[float]:
        """The measured value of each axis."""
        found = [0.0 if goal is None else goal - SAG for goal in self.goals]
        return [self.blocked.get(index, value) for index, value in enumerate(found)]

    def measured(self) -> Message:
        return {"axes": self.places, "goals": self.goals, "at_rest": self.wanted == neutral_values(ARM.axes)}

    def is_proper(self, command: Message) -> str:
        if len(command["values"]) != len(ARM.axes):
            return "wrong_size"
        for axis, value in zip(ARM.axes, command["values"], strict=True):
            if axis.kind == "rate" if value is None else not math.isfinite(value):
                return "not_a_number"
        return "stopped" if self.stop["stopped"] else ""

    def may_execute(self, command: Message) -> str:
        answered = self.issues.get(command["issue"])
        if command["event"] != event_after(self.event):
            return "out_of_order"
        if answered is None or time.monotonic() - answered["time"] > AGE:
            return "late"
        if command["nonce"] != answered["nonce"]:
            return "unseen"
        if list(command["values"]) == neutral_values(ARM.axes):
            return ""
        if self.voided and event_gap(command["event"], self.voided) <= 0:
            return "rested"
        if self.neutral_needed:
            return "not_neutral"
        axes = zip(ARM.axes, command["values"], self.places, strict=True)
        far = any(
            axis.kind == "goal" and value is not None and abs(distance(axis, measured, value)) > axis.reach
            for axis, value, measured in axes
        )
        return "jump" if far else ""

    def execute(self, command: Message) -> None:
        self.executed_values.append(list(command["values"]))
        self.executed, self.speed = time.monotonic(), command["speed"]
        self.wanted = list(command["values"])
        if self.wanted == neutral_values(ARM.axes):
            self.neutral_needed = False
            self.presses.clear()
        self.event, self.issue, self.issues = command["event"], 0, {}
        self.measure()

    def rest(self, rest: Message) -> None:
        following = event_after(self.event)
        if event_gap(self.event, rest["event"]) > 0:
            return
        self.rests += 1
        self.wanted = neutral_values(ARM.axes)
        self.voided = following if event_gap(rest["event"], following) > 0 else rest["event"]

    def press(self, stop: Message) -> int:
        self.wanted = neutral_values(ARM.axes)
        return super().press(stop)


def distance(axis: Axis, start: float, goal: float) -> float:
    return goal - start if axis.wrap is None else math.remainder(goal - start, axis.wrap)


@asynccontextmanager
async def running_goal_robot() -> AsyncIterator[GoalRobot]:
    robot = GoalRobot()
    async with serving(robot):
        yield robot
