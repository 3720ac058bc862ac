"""Turns the value of an axis into the control signal of an actuator, one drive for each.

At rest nothing moves: a position servo keeps its posture, a velocity servo stands still, and a motor brakes and then
holds the place as far as its force allows.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Collection
from typing import Any, Final

import numpy as np

from lockstep.protocol.description import Axis
from lockstep.robot_bridge.errors import ModelError
from lockstep.robot_bridge.robots.mjcf.actuators import Actuator, Kind
from lockstep.robot_bridge.robots.mjcf.names import label_of

__all__ = ["Drive", "drives_of"]

SLEW_TIME: Final = 0.25  # s from rest to the fastest
BRAKE_TIME: Final = 0.1  # s from the fastest to rest
CROSSING: Final = 4.0  # s from one end of a range to the other, at the fastest
FASTEST_TURN: Final = 1.5  # rad/s
FASTEST_UNBOUND: Final = 1.0  # rad/s, without a range
SHARE_OF_EXTENT: Final = 0.15  # of the model's size per second, for slides without a range
FURTHEST_LEAD: Final = 0.25  # of the range, or rad, that a servo's goal may be ahead of a blocked joint
HOLD_RATE: Final = 2 * math.pi * 3.0  # rad/s, stiffness with which a motor at rest holds, independent of its load
SLOW: Final = 0.05  # rad/s, or of the model's size per second: below it a motor at rest holds instead of braking


class Drive(ABC):
    """An axis and its actuator. Call `drive` before each step of the simulation."""

    def __init__(self, actuator: Actuator, axis: Axis) -> None:
        self.actuator = actuator
        self.axis = axis

    @abstractmethod
    def drive(self, data: Any, value: float, seconds: float) -> None:
        """Set the control for the coming `seconds`."""

    @abstractmethod
    def measured(self, data: Any) -> float:
        """Return the measured value of the axis."""

    def at_rest(self, value: float) -> float:
        """Return the value that keeps the axis where the present value has brought it."""
        return self.axis.rest

    def release(self, data: Any) -> None:
        """Forget the held places, because the state was put back to its beginning."""


class _JointDrive(Drive):
    """Moves a joint with one degree of freedom, or another transmission that has a length."""

    def __init__(self, model: Any, actuator: Actuator, axis: Axis) -> None:
        super().__init__(actuator, axis)
        joint = actuator.joint
        self._qpos = None if joint is None else int(model.jnt_qposadr[joint])
        self._dof = None if joint is None else int(model.jnt_dofadr[joint])

    def _position(self, data: Any) -> float:
        place = data.actuator_length[self.actuator.number] if self._qpos is None else data.qpos[self._qpos]
        return float(place)

    def _velocity(self, data: Any) -> float:
        rate = data.actuator_velocity[self.actuator.number] if self._dof is None else data.qvel[self._dof]
        return float(rate)

    def measured(self, data: Any) -> float:
        return self._velocity(data)


class PositionDrive(_JointDrive):
    """Drives a position servo: the axis is the speed of its goal, so that letting go keeps the posture."""

    def __init__(self, model: Any, data: Any, actuator: Actuator, axis: Axis, low: float, high: float) -> None:
        super().__init__(model, actuator, axis)
        self._low, self._high = low, high
        span = high - low
        self._lead = FURTHEST_LEAD * (span if math.isfinite(span) else 1.0)
        self._goal = 0.0
        self.release(data)

    def release(self, data: Any) -> None:
        self._goal = min(max(self._position(data), self._low), self._high)

    def drive(self, data: Any, value: float, seconds: float) -> None:
        if value:
            goal = min(max(self._goal + value * seconds, self._low), self._high)
            # A blocked joint is not pushed ever harder, and a missed motion is not made good later.
            if abs(goal - self._position(data)) < max(self._lead, abs(self._goal - self._position(data))):
                self._goal = goal
        data.ctrl[self.actuator.number] = self._goal * self.actuator.gear


class GoalDrive(_JointDrive):
    """Drives a position servo by its goal, which the bridge moves: the value is the place to be at."""

    def measured(self, data: Any) -> float:
        return self._position(data)

    def at_rest(self, value: float) -> float:
        return value

    def drive(self, data: Any, value: float, seconds: float) -> None:
        data.ctrl[self.actuator.number] = value * self.actuator.gear


class VelocityDrive(_JointDrive):
    """Drives a velocity servo: the axis is its commanded velocity."""

    def drive(self, data: Any, value: float, seconds: float) -> None:
        data.ctrl[self.actuator.number] = value * self.actuator.gear


class MotorDrive(_JointDrive):
    """Drives a motor: the axis is a force or torque.

    At rest the motor brakes; once slow enough, it holds the place against gravity.
    """

    def __init__(self, model: Any, actuator: Actuator, axis: Axis) -> None:
        super().__init__(model, actuator, axis)
        self._ratio = float(model.actuator_gear[actuator.number, 0]) or 1.0
        gain = float(model.actuator_gainprm[actuator.number, 0]) or 1.0
        self._ratio *= gain  # force on the joint per control
        self._slow = SLOW * (1.0 if actuator.is_rotary else float(model.stat.extent))
        self._held: float | None = None  # the held place; None while driving or still too fast
        self._diagonal = None if self._dof is None else int(model.M_rowadr[self._dof] + model.M_rownnz[self._dof] - 1)

    def release(self, data: Any) -> None:
        self._held = None

    def measured(self, data: Any) -> float:
        return float(data.actuator_force[self.actuator.number])

    def drive(self, data: Any, value: float, seconds: float) -> None:
        control = value
        if value:
            self._held = None
        elif self._dof is not None:
            control = self._holding(data) / self._ratio
        data.ctrl[self.actuator.number] = min(max(control, self.axis.minimum), self.axis.maximum)

    def _holding(self, data: Any) -> float:
        """Return the force on the joint that brakes it and then keeps it where it stands."""
        speed, place = self._velocity(data), self._position(data)
        if self._held is None and abs(speed) < self._slow:
            self._held = place
        inertia = float(data.M[self._diagonal])
        stiff = 0.0 if self._held is None else HOLD_RATE * HOLD_RATE * (self._held - place)
        return float(data.qfrc_bias[self._dof]) + inertia * (stiff - 2.0 * HOLD_RATE * speed)


class PlainDrive(Drive):
    """Drives any other actuator: the axis is the control itself, and rests where the control is nearest to zero."""

    def drive(self, data: Any, value: float, seconds: float) -> None:
        data.ctrl[self.actuator.number] = value

    def measured(self, data: Any) -> float:
        return float(data.ctrl[self.actuator.number])


def drives_of(
    model: Any, data: Any, actuators: list[Actuator], goals: Collection[int] = (), grippers: Collection[int] = ()
) -> list[Drive]:
    """Return a drive for each actuator that gets an axis.

    `goals`: numbers of the servos that are goal axes. `grippers`: of the goal axes that grip.

    A velocity servo on a joint that also has a position servo only damps it, and gets none.

    Raises:
        ModelError: a goal axis would have no range.
    """
    servoed = {each.joint for each in actuators if each.kind is Kind.POSITION and each.joint is not None}
    return [
        GoalDrive(model, each, _goal_axis(model, each, grips=each.number in grippers))
        if each.number in goals
        else _drive(model, data, each)
        for each in actuators
        if not (each.kind is Kind.VELOCITY and each.joint is not None and each.joint in servoed)
    ]


def _drive(model: Any, data: Any, actuator: Actuator) -> Drive:
    if actuator.kind is Kind.POSITION:
        low, high = _range(model, actuator)
        return PositionDrive(model, data, actuator, _speed_axis(model, actuator, _fastest(model, actuator)), low, high)
    if actuator.kind is Kind.VELOCITY:
        return VelocityDrive(model, actuator, _velocity_axis(model, actuator))
    if actuator.kind is Kind.MOTOR:
        return MotorDrive(model, actuator, _force_axis(model, actuator))
    low, high = (-1.0, 1.0) if math.isinf(actuator.low) else (actuator.low, actuator.high)
    return PlainDrive(actuator, _axis(actuator, "", low, high, min(max(0.0, low), high)))


def _goal_axis(model: Any, actuator: Actuator, *, grips: bool) -> Axis:
    low, high = _range(model, actuator)
    wrap = None
    if not (math.isfinite(low) and math.isfinite(high)):
        if not actuator.is_rotary:
            raise ModelError(f"actuator {actuator.name} cannot be a goal axis: neither its joint nor it has a range")
        low, high, wrap = -math.pi, math.pi, math.tau
    slew = _fastest(model, actuator)
    return Axis(
        name=actuator.name,
        label=label_of(actuator.name),
        unit="rad" if actuator.is_rotary else "m",
        minimum=low,
        maximum=high,
        kind="goal",
        slew=slew,
        brake=slew / BRAKE_TIME,
        acceleration=slew / SLEW_TIME,
        reach=FURTHEST_LEAD * (high - low),
        wrap=wrap,
        grips=grips,
    )


def _velocity_axis(model: Any, actuator: Actuator) -> Axis:
    if math.isinf(actuator.low) or not actuator.low <= 0.0 <= actuator.high:
        return _speed_axis(model, actuator, _fastest(model, actuator))
    return _axis(actuator, "rad/s" if actuator.is_rotary else "m/s", actuator.low, actuator.high)


def _speed_axis(model: Any, actuator: Actuator, fastest: float) -> Axis:
    return _axis(actuator, "rad/s" if actuator.is_rotary else "m/s", -fastest, fastest)


def _force_axis(model: Any, actuator: Actuator) -> Axis:
    low, high = actuator.low, actuator.high
    if math.isinf(low):
        low, high = (
            (float(bound) for bound in model.actuator_forcerange[actuator.number])
            if model.actuator_forcelimited[actuator.number]
            else (-1.0, 1.0)
        )
    # With a gear or a gain the control is a share of the force, not the force.
    number = actuator.number
    is_force = abs(float(model.actuator_gear[number, 0]) * float(model.actuator_gainprm[number, 0])) == 1.0
    unit = ("N m" if actuator.is_rotary else "N") if is_force and actuator.joint is not None else ""
    return _axis(actuator, unit, low, high, min(max(0.0, low), high))


def _axis(actuator: Actuator, unit: str, low: float, high: float, rest: float = 0.0) -> Axis:
    furthest = max(high - rest, rest - low) or 1.0
    return Axis(
        name=actuator.name,
        label=label_of(actuator.name),
        unit=unit,
        minimum=low,
        maximum=high,
        slew=furthest / SLEW_TIME,
        brake=furthest / BRAKE_TIME,
        rest=rest,
    )


def _range(model: Any, actuator: Actuator) -> tuple[float, float]:
    """Return the range of a position servo's goal."""
    low, high = actuator.low, actuator.high
    if actuator.joint is not None and model.jnt_limited[actuator.joint]:
        lower, upper = (float(bound) for bound in model.jnt_range[actuator.joint])
        low, high = max(low, lower), min(high, upper)
    return (low, high) if low <= high else (actuator.low, actuator.high)


def _fastest(model: Any, actuator: Actuator) -> float:
    """Return the speed limit of a joint whose speed the model does not bound."""
    low, high = _range(model, actuator) if actuator.kind is Kind.POSITION else _joint_range(model, actuator)
    span = high - low
    if math.isfinite(span) and span > 0:
        return min(span / CROSSING, FASTEST_TURN) if actuator.is_rotary else span / CROSSING
    return FASTEST_UNBOUND if actuator.is_rotary else SHARE_OF_EXTENT * float(model.stat.extent)


def _joint_range(model: Any, actuator: Actuator) -> tuple[float, float]:
    if actuator.joint is None or not model.jnt_limited[actuator.joint]:
        return -np.inf, np.inf
    lower, upper = model.jnt_range[actuator.joint]
    return float(lower), float(upper)
