"""Drives an arm to the goals of its joints, or its tool to a pose, by the positions that its controller takes."""

import math
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

from lockstep.protocol.description import RobotDescription
from lockstep.robot_bridge.control import clock
from lockstep.robot_bridge.robots.ros2.arm_goals import ArmGoals
from lockstep.robot_bridge.robots.ros2.drives.arm_drive import PACKAGES
from lockstep.robot_bridge.robots.ros2.drives.command_stream import Said
from lockstep.robot_bridge.robots.ros2.drives.drive import Drive, Sensed
from lockstep.robot_bridge.robots.ros2.drives.joint_feedback import JointFeedback
from lockstep.robot_bridge.robots.ros2.drives.position_messages import PositionMessages
from lockstep.robot_bridge.robots.ros2.ros_side import RosSide
from lockstep.robot_bridge.robots.ros2.settings import Arm

__all__ = ["GoalArmDrive"]

QUIET: Final = 0.5  # s without a word, after which the arm is looked at: something else may have moved it
SAME: Final = 1e-9  # rad or m


class _Bounds(NamedTuple):
    """Of the published positions of each joint."""

    horizon: float  # s, by which they are ahead of a goal that moves
    ranges: list[tuple[float, float]]  # rad or m
    leads: list[float]  # rad or m, from where the joint is


class GoalArmDrive(Drive):
    """An arm whose axes are the places of its joints, and the pose of its tool.

    While the joints' goals move they are published ahead by the horizon; when they stand still, once more as they are.
    """

    def __init__(self, ros: RosSide, settings: Arm, description: RobotDescription, tick_seconds: float) -> None:
        command = settings.command
        kind = ros.interface(f"{PACKAGES[command.message]}/msg/{command.message}")
        count = len(settings.joints)
        size = count + sum(len((*pose.position, *pose.rotation)) for pose in description.poses)
        super().__init__(ros, kind, command.topic, command.rate, size, tick_seconds)
        self._settings = settings
        self._described = description
        self._joints = count
        axes = {axis.name: axis for axis in description.axes}
        own = [axes[f"arm.{joint.name}"] for joint in settings.joints]
        self._bounds = _Bounds(
            horizon=command.horizon,
            ranges=[(-math.inf, math.inf) if axis.wrap else (axis.minimum, axis.maximum) for axis in own],
            leads=[joint.maximum * command.lead for joint in settings.joints],
        )
        self._feedback = JointFeedback(ros, settings.states, [joint.name for joint in settings.joints])
        self._messages = PositionMessages(ros, command, [joint.name for joint in settings.joints], kind)
        self._goals: ArmGoals | None = None  # until the arm was measured
        self._before: list[float] = []  # values of the tick before
        self._ticked_at: float | None = None  # s
        self._spoke_at = float("-inf")  # s, when a joint's goal moved last
        self._held = True  # the arm could not be driven in the last tick
        self._moved = False  # the goals are others than those applied, and the bridge does not know yet
        self._looked = False  # in this tick it was asked already whether something else has moved the arm
        self.pursues = False  # a command drives the tool

    def seen(self, now: float) -> bool:
        return self._feedback.is_complete(now)

    def step(self, values: Sequence[float], dt: float) -> None:
        now = clock.now()
        since = dt if self._ticked_at is None else now - self._ticked_at
        self._ticked_at = now
        changed = any(abs(a - b) > SAME for a, b in zip(values, self._before, strict=False))
        self._before = list(values)
        lost = self.lost(now)
        held = lost or self._stream.withheld
        rates = self._advance(values, dt, since, now, held)
        if held and changed:  # goals that move have to end before the arm is driven again; nothing of this is published
            rates = [1.0] * self.size
            self._moved |= not self._stopped and lost
        step = self._stream.step(rates, lost, now)
        self.topic.publish(self.advance(step.said, step.values, dt), step.said)

    def prepare(self) -> None:
        """Compute what the next `step` needs of the joints alone."""
        if self._goals is not None:
            self._goals.prepare()

    def advance(self, said: Said, values: list[float], dt: float) -> Any:
        if said is Said.NOTHING or self._goals is None:
            return None
        rates = values[: self._joints]
        moved = rates if said is Said.VALUES else [0.0] * self._joints
        points = _points(self._goals.goals, moved, self.joints(clock.now()), self._bounds)
        return self._messages.make(points, rates)

    def stop(self) -> None:
        if self._goals is not None:
            self._goals.hold()
        super().stop()

    def reset(self) -> None:
        super().reset()
        self._moved = False
        if self._goals is not None:
            self._goals.restart()

    def rest_from_thread(self) -> None:
        if self._goals is not None:
            self._goals.hold()
        super().rest_from_thread()

    def sense(self, now: float) -> Sensed:
        seen = self._begun(now) and self.seen(now)  # first: a state that comes meanwhile is only newer
        known = self._feedback.known(now)
        positions = [joint.position for joint in known]
        axes = [*positions, *[math.nan] * (self.size - len(positions))]
        if seen and self._goals is not None:
            axes = self._goals.measured_axes(positions)
        return Sensed(axes, positions, self._feedback.is_still(known))

    def goals(self, now: float) -> list[float]:
        """Return the goal of each axis; where the arm is before the first motion."""
        return self._goals.pursued() if self._begun(now) and self._goals is not None else self.measured_axes(now)

    def take_up(self, now: float) -> list[float]:
        """Begin anew where others have moved the arm, unless it was just driven; return the goals then, else NaN.

        The next `step` leaves them there: its values are these, and others would lead back to them.
        """
        self._looked = True
        if not self._held and self._goals is not None and now - self._spoke_at > QUIET and self.seen(now):
            self._moved |= self._goals.take_up(self.joints(now))
        return self.goals(now) if self._moved else [math.nan] * self.size

    def joints(self, now: float) -> list[float]:
        return [joint.position for joint in self._feedback.known(now)]

    def sensor_faults(self, now: float) -> list[str]:
        return self._feedback.faults(now) + ([] if self._goals is None else self._goals.faults)

    def _begun(self, now: float) -> bool:
        """Begin where the arm is measured first. Return whether it was."""
        if self._goals is None and self.seen(now):
            self._goals = ArmGoals(self._settings, self._described, self.joints(now))
        return self._goals is not None

    def _advance(self, values: Sequence[float], dt: float, since: float, now: float, held: bool) -> list[float]:
        """Let a tick pass; return the joints' rates, and nought for each axis of the tool."""
        still = [0.0] * self.size
        self._held = held
        if self._looked:
            self._moved = False  # the bridge knows
        elif not held:
            self.take_up(now)
        self._looked = False
        if not self._begun(now) or self._goals is None:
            return still
        if held:
            self._goals.hold()
            return still
        rates = self._goals.drive(values, dt, since, self.joints(now), self.pursues)
        if any(rates):
            self._spoke_at = now
        still[: len(rates)] = rates
        return still


def _points(goals: Sequence[float], rates: Sequence[float], measured: Sequence[float], bounds: _Bounds) -> list[float]:
    """Return the positions to publish, which never run far ahead of a joint that is blocked, nor out of its range.

    A goal that is outside already is published as it is.
    """
    ahead = [
        min(max(goal + rate * bounds.horizon, min(lower, goal)), max(upper, goal))
        for goal, rate, (lower, upper) in zip(goals, rates, bounds.ranges, strict=True)
    ]
    return [
        point if place != place else min(max(point, place - lead), place + lead)
        for point, place, lead in zip(ahead, measured, bounds.leads, strict=True)
    ]
