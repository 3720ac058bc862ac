"""Checks the axes and the poses of a robot's description."""

import math
from collections.abc import Iterable

from lockstep.protocol.description import Axis, Pose, RobotDescription
from lockstep.robot_bridge.control.limits.axis_shaper import LATE_TIMER
from lockstep.robot_bridge.errors import DescriptionError

__all__ = ["check_axes", "check_braking"]

POSITION_UNIT = "m"
ROTATION_UNIT = "rad"
ROUNDING = 1e-9  # s


def check_axes(description: RobotDescription) -> None:
    """Check each axis, and the parts of the description that only axes of one kind can have.

    Raises:
        DescriptionError: names the first contradiction found.
    """
    settling = {name: pose.settling for pose in description.poses for name in (*pose.position, *pose.rotation)}
    for axis in description.axes:
        if axis.kind == "goal":
            _check_goal_axis(axis, description.hold, settling.get(axis.name, 0.0))
        else:
            _check_rate_axis(axis, description.hold)
    goals = {axis.name: axis for axis in description.axes if axis.kind == "goal"}
    _check_poses(description, goals)
    for where, names in _rate_users(description):
        for name in names:
            if name in goals:
                raise DescriptionError(f"{where} names the axis {name!r}, which is a goal axis: it needs a rate axis")


def check_braking(description: RobotDescription, tick_seconds: float) -> None:
    """Check that each axis can keep its full speed: it has to be at rest by the last control tick within `hold`.

    That tick leaves room for the next one, and for a late timer.

    Raises:
        DescriptionError: names the first axis that cannot.
    """
    settling = {name: pose.settling for pose in description.poses for name in (*pose.position, *pose.rotation)}
    for axis in description.axes:
        fastest = axis.slew if axis.kind == "goal" else max(axis.maximum - axis.rest, axis.rest - axis.minimum)
        taken = fastest / axis.brake + settling.get(axis.name, 0.0)
        until_next = tick_seconds + LATE_TIMER
        if until_next >= description.hold or taken + until_next > description.hold + ROUNDING:
            raise DescriptionError(
                f"axis {axis.name}: coming to rest takes {taken:.3f} s, a control tick {tick_seconds:g} s, which may be"
                f" {LATE_TIMER:g} s late: together longer than hold ({description.hold:g} s); raise brake or lower"
                " the limits"
            )


def _check_rate_axis(axis: Axis, hold: float) -> None:
    _check_numbers(axis, (axis.minimum, axis.maximum, axis.slew, axis.brake, axis.rest))
    if not axis.minimum <= axis.rest <= axis.maximum:
        raise DescriptionError(f"axis {axis.name}: rest must lie between minimum and maximum")
    furthest = max(axis.maximum - axis.rest, axis.rest - axis.minimum)
    if furthest > axis.brake * hold:
        raise DescriptionError(
            f"axis {axis.name}: braking from {furthest:g} {axis.unit} takes {furthest / axis.brake:.3f} s,"
            f" longer than hold ({hold:g} s); raise brake or lower the limits"
        )


def _check_goal_axis(axis: Axis, hold: float, settling: float) -> None:
    _check_numbers(axis, (axis.minimum, axis.maximum, axis.slew, axis.brake, axis.acceleration, axis.reach))
    if not axis.minimum <= axis.maximum:
        raise DescriptionError(f"axis {axis.name}: minimum must not be above maximum")
    if axis.acceleration < 0:
        raise DescriptionError(f"axis {axis.name}: acceleration must not be negative; 0 means as brake")
    if axis.reach <= 0:
        raise DescriptionError(f"axis {axis.name}: a goal axis needs a reach above 0, how far a goal may be away")
    if not 0 <= settling < hold:
        raise DescriptionError(f"axis {axis.name}: settling of its pose must be from 0 to less than hold ({hold:g} s)")
    if axis.slew > axis.brake * hold:
        raise DescriptionError(
            f"axis {axis.name}: braking from {axis.slew:g} {axis.unit}/s takes {axis.slew / axis.brake:.3f} s,"
            f" longer than hold ({hold:g} s); raise brake or lower slew"
        )
    if axis.slew / axis.brake + settling > hold + ROUNDING:
        raise DescriptionError(
            f"axis {axis.name}: braking takes {axis.slew / axis.brake:.3f} s and settling {settling:g} s, together"
            f" longer than hold ({hold:g} s)"
        )
    if axis.wrap is None:
        return
    if not (math.isfinite(axis.wrap) and axis.wrap > 0):
        raise DescriptionError(f"axis {axis.name}: wrap must be positive and finite, not {axis.wrap}")
    if axis.maximum - axis.minimum < axis.wrap * (1 - 1e-9):
        raise DescriptionError(
            f"axis {axis.name}: an axis with wrap has no ends, and its range is smaller than the period {axis.wrap:g}"
        )
    if axis.reach > axis.wrap / 2:
        raise DescriptionError(f"axis {axis.name}: reach must be at most half of wrap: no place is further away")


def _check_numbers(axis: Axis, numbers: Iterable[float]) -> None:
    if not all(map(math.isfinite, numbers)):
        raise DescriptionError(f"axis {axis.name}: every number must be finite")
    if axis.slew <= 0 or axis.brake <= 0:
        raise DescriptionError(f"axis {axis.name}: slew and brake must be positive")


def _check_poses(description: RobotDescription, goals: dict[str, Axis]) -> None:
    known = {"", *(body.name for body in description.bodies)}
    frames = known | {camera.name for camera in description.cameras}
    used: set[str] = set()
    names: set[str] = set()
    for pose in description.poses:
        where = f"pose {pose.name}"
        if not pose.name or pose.name in names:
            raise DescriptionError(f"pose name {pose.name!r} is empty or used twice")
        names.add(pose.name)
        if not pose.body or pose.body not in known:
            raise DescriptionError(f"{where} names the body {pose.body!r}, which is not described")
        if pose.frame not in frames:
            raise DescriptionError(f"{where} names the frame {pose.frame!r}, which is no body and no camera")
        if pose.frame and pose.frame in known and any(camera.name == pose.frame for camera in description.cameras):
            raise DescriptionError(f"{where} names the frame {pose.frame!r}, which is a body and a camera")
        if not all(map(math.isfinite, pose.point)):
            raise DescriptionError(f"{where}: its point must be finite")
        _check_pose_axes(where, pose, goals, used)
    for pose in description.poses:
        for name in pose.instead_of:
            if name in used:
                raise DescriptionError(f"pose {pose.name}: {name!r} is an axis of a pose and cannot be in instead_of")


def _check_pose_axes(where: str, pose: Pose, goals: dict[str, Axis], used: set[str]) -> None:
    for names, unit in ((pose.position, POSITION_UNIT), (pose.rotation, ROTATION_UNIT)):
        for name in filter(None, names):
            _check_goal(where, name, goals)
            if goals[name].unit != unit:
                raise DescriptionError(f"{where}: axis {name} must have the unit {unit}, not {goals[name].unit!r}")
            if name in used:
                raise DescriptionError(f"{where}: axis {name} is in two poses, or twice in one")
            used.add(name)
    if not any((*pose.position, *pose.rotation)):
        raise DescriptionError(f"{where} has no axes")
    if len(set(pose.instead_of)) < len(pose.instead_of):
        raise DescriptionError(f"{where}: an axis is twice in instead_of")
    for name in pose.instead_of:
        _check_goal(where, name, goals)


def _check_goal(where: str, name: str, goals: dict[str, Axis]) -> None:
    if name not in goals:
        raise DescriptionError(f"{where} names the axis {name!r}, which is not a goal axis of this robot")


def _rate_users(description: RobotDescription) -> Iterable[tuple[str, Iterable[str]]]:
    """Yield the parts that need rate axes, and the axes that they name."""
    if (base := description.planar_base) is not None:
        yield "planar_base", (base.forward, base.left, base.turn)
    if (warning := description.start_warning) is not None:
        yield "start_warning", (warning.axis,)
    for twist in description.body_twists:
        yield f"the twist of {twist.body}", (*twist.linear, *twist.angular)
