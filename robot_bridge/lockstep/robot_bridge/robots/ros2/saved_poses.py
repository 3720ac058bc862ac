"""Postures of an arm that its settings name (`arm.poses`), as actions that take its goal axes there."""

import math
from collections.abc import Collection, Mapping, Sequence

from lockstep.protocol.description import Action, Axis
from lockstep.robot_bridge.robots.ros2.joint_axes import is_goal_arm
from lockstep.robot_bridge.robots.ros2.settings import Arm
from lockstep.robot_bridge.yaml_file import SettingsPlace

__all__ = ["pose_actions", "pose_goals"]


def pose_actions(arm: Arm, axes: Sequence[Axis], taken: Collection[str]) -> tuple[Action, ...]:
    """Return an action for each posture. `axes`: of the arm's joints. `taken`: names of other actions.

    Raises:
        SettingsPlace: a posture is not one of this arm.
    """
    if arm.poses and not is_goal_arm(arm):
        raise SettingsPlace(("arm", "poses"), "poses need axes that are goals: set goals: true, or give a tool")
    for name, values in arm.poses.items():
        place = ("arm", "poses", name)
        if name in taken:
            raise SettingsPlace(place, "is the name of another action")
        if len(values) != len(axes):
            raise SettingsPlace(place, f"needs one value for each of the {len(axes)} joints, not {len(values)}")
        for number, (value, axis) in enumerate(zip(values, axes, strict=True)):
            _check(value, axis, (*place, number))
    return tuple(Action(name=name, label=_label(name)) for name in arm.poses)


def pose_goals(arm: Arm, axes: Sequence[Axis]) -> dict[str, Mapping[int, float]]:
    """Return the goals of each posture by its name: rad or m, by number of axis. `axes`: all of the robot."""
    numbers = {axis.name: number for number, axis in enumerate(axes)}
    own = [numbers[f"arm.{joint.name}"] for joint in arm.joints]
    return {
        name: {number: _wrapped(value, axes[number]) for number, value in zip(own, values, strict=True)}
        for name, values in arm.poses.items()
    }


def _check(value: float, axis: Axis, place: tuple[str | int, ...]) -> None:
    if not math.isfinite(value):
        raise SettingsPlace(place, "needs a number")
    if axis.wrap is None and not axis.minimum <= value <= axis.maximum:
        name = axis.name.removeprefix("arm.")
        raise SettingsPlace(place, f"{value:g} is not in the range of {name}, {axis.minimum:g} to {axis.maximum:g}")


def _wrapped(value: float, axis: Axis) -> float:
    return value if axis.wrap is None else math.remainder(value, axis.wrap)


def _label(name: str) -> str:
    words = name.replace("_", " ").strip()
    return (words[:1].upper() + words[1:]) or name
