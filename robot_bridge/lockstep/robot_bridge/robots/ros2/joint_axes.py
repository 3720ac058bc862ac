"""The axes of an arm's joints: how fast each one moves, or where it is to be."""

import math
from typing import Final

from lockstep.protocol.description import Axis
from lockstep.robot_bridge.robots.ros2.settings import Arm, ArmJoint
from lockstep.robot_bridge.yaml_file import SettingsPlace

__all__ = ["SLEW_TIME", "brake_for", "is_goal_arm", "joint_axes"]

SLEW_TIME: Final = 0.5  # s from rest to full speed unless the settings say otherwise
BRAKE_SHARE: Final = 0.5  # of `hold`, from full speed to rest
GOAL_SHARE: Final = 0.75  # of a joint's full speed, at which its own goal moves: the tool's may need all of it
REACH: Final = {"rad": 0.5, "m": 0.1}


def is_goal_arm(arm: Arm) -> bool:
    """Return whether the axes of an arm are goals."""
    return arm.goals or arm.tool is not None


def joint_axes(arm: Arm, hold: float) -> tuple[Axis, ...]:
    """Return an axis for each joint.

    Raises:
        SettingsPlace: the settings contradict each other.
    """
    if not is_goal_arm(arm):
        return tuple(_rate_axis(joint, number, hold) for number, joint in enumerate(arm.joints))
    if arm.command.message == "Float64MultiArray" and arm.command.interface == "velocity":
        raise SettingsPlace(("arm", "command", "message"), "goals need positions: set interface: position if it has it")
    return tuple(_goal_axis(joint, number, hold) for number, joint in enumerate(arm.joints))


def brake_for(brake: float | None, fastest: float, hold: float, keys: tuple[str | int, ...]) -> float:
    """Return how fast an axis brakes, per second.

    Raises:
        SettingsPlace: that takes longer than `hold`.
    """
    if brake is None:
        return fastest / (BRAKE_SHARE * hold)
    if fastest > brake * hold:
        taken = fastest / brake
        raise SettingsPlace(keys, f"braking from {fastest:g} would take {taken:.2f} s, longer than hold ({hold:g} s)")
    return brake


def _rate_axis(joint: ArmJoint, number: int, hold: float) -> Axis:
    return Axis(
        name=f"arm.{joint.name}",
        label=joint.label or joint.name,
        unit=f"{joint.unit}/s",
        minimum=-joint.maximum,
        maximum=joint.maximum,
        slew=joint.slew or joint.maximum / SLEW_TIME,
        brake=brake_for(joint.brake, joint.maximum, hold, ("arm", "joints", number, "brake")),
    )


def _goal_axis(joint: ArmJoint, number: int, hold: float) -> Axis:
    place = ("arm", "joints", number)
    lower, upper, wrap = joint.lower, joint.upper, None
    if lower is None and upper is None and joint.unit == "rad":
        lower, upper, wrap = -math.pi, math.pi, math.tau
    if lower is None or upper is None:
        raise SettingsPlace((*place, "name"), "a goal needs both ends of its range: give lower and upper")
    if not lower + joint.margin < upper - joint.margin:
        raise SettingsPlace((*place, "lower"), "no range is left between lower and upper")
    fastest = GOAL_SHARE * joint.maximum
    reach = joint.reach or REACH[joint.unit]
    return Axis(
        name=f"arm.{joint.name}",
        label=joint.label or joint.name,
        unit=joint.unit,
        minimum=lower + joint.margin,
        maximum=upper - joint.margin,
        slew=fastest,
        brake=brake_for(joint.brake, fastest, hold, (*place, "brake")),
        kind="goal",
        acceleration=joint.slew or fastest / SLEW_TIME,
        reach=reach if wrap is None else min(reach, math.pi),
        wrap=wrap,
        grips=joint.grips,
    )
