"""Classifies the actuators of the model by the way in which they are driven."""

import math
from enum import Enum
from typing import Any, Final, NamedTuple

import mujoco

from lockstep.robot_bridge.robots.mjcf.names import name_of

__all__ = ["Actuator", "Kind", "actuators_of"]

JOINT_TRANSMISSIONS: Final = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
TENDON: Final = int(mujoco.mjtTrn.mjTRN_TENDON)
HINGE: Final = int(mujoco.mjtJoint.mjJNT_HINGE)
SLIDE: Final = int(mujoco.mjtJoint.mjJNT_SLIDE)
FIXED_GAIN: Final = int(mujoco.mjtGain.mjGAIN_FIXED)
NO_BIAS: Final = int(mujoco.mjtBias.mjBIAS_NONE)
AFFINE_BIAS: Final = int(mujoco.mjtBias.mjBIAS_AFFINE)
NO_DYNAMICS: Final = int(mujoco.mjtDyn.mjDYN_NONE)
INTEGRATOR: Final = int(mujoco.mjtDyn.mjDYN_INTEGRATOR)
SAME: Final = 1e-3  # of the gain


class Kind(Enum):
    """The meaning of an actuator's control signal."""

    POSITION = "position"  # the place to be at
    VELOCITY = "velocity"  # the speed to go at
    MOTOR = "motor"  # a force or torque
    OTHER = "other"  # muscles, adhesion, damping …


class Actuator(NamedTuple):
    number: int
    name: str
    kind: Kind
    joint: int | None  # the joint it moves; None: a tendon, a site, or a joint with more than one degree of freedom
    tendon: int | None
    gear: float  # control per value of the axis
    low: float  # bound of the axis: control divided by the gear; infinite without a range
    high: float
    is_rotary: bool


def actuators_of(model: Any) -> list[Actuator]:
    """Return all actuators of a model, in order."""
    return [_actuator(model, number) for number in range(model.nu)]


def _actuator(model: Any, number: int) -> Actuator:
    transmission, target = int(model.actuator_trntype[number]), int(model.actuator_trnid[number, 0])
    joint = target if transmission in JOINT_TRANSMISSIONS and model.jnt_type[target] in (HINGE, SLIDE) else None
    gear = float(model.actuator_gear[number, 0]) if joint is not None else 1.0
    kind = _kind(model, number)
    if kind in (Kind.MOTOR, Kind.OTHER) or gear == 0.0:
        gear = 1.0
    low, high = (float(bound) / gear for bound in model.actuator_ctrlrange[number])
    if not model.actuator_ctrllimited[number]:
        low, high = -math.inf, math.inf
    return Actuator(
        number=number,
        name=name_of(model, "actuator", number),
        kind=kind,
        joint=joint,
        tendon=target if transmission == TENDON else None,
        gear=gear,
        low=min(low, high),
        high=max(low, high),
        is_rotary=joint is not None and model.jnt_type[joint] == HINGE,
    )


def _kind(model: Any, number: int) -> Kind:
    if model.actuator_gaintype[number] != FIXED_GAIN:
        return Kind.OTHER
    gain, bias = float(model.actuator_gainprm[number, 0]), model.actuator_biasprm[number, :3]
    dynamics = int(model.actuator_dyntype[number])
    if model.actuator_biastype[number] == AFFINE_BIAS and gain > 0:
        if abs(gain + float(bias[1])) < SAME * gain:
            return Kind.VELOCITY if dynamics == INTEGRATOR else Kind.POSITION
        if bias[1] == 0 and abs(gain + float(bias[2])) < SAME * gain and dynamics == NO_DYNAMICS:
            return Kind.VELOCITY
        return Kind.OTHER
    is_plain = model.actuator_biastype[number] == NO_BIAS and dynamics == NO_DYNAMICS
    return Kind.MOTOR if is_plain else Kind.OTHER
