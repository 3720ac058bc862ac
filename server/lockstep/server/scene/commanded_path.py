"""Computes the poses to which the latest commands would have led the robot, by its description alone. No I/O.

Beside the measured robot this shows the effect of slew, slip, a limit or an obstacle. Commands are those that the
console forwarded under each event; each counts from the feedback of its event until the next one, by the bridge's
clock, and no longer than the robot holds a command. At rest nothing counts.

A goal axis says where it is to be: its newest command counts, or where it stays if that was null. It is drawn by the
joint that a position limit names, by the joint of its own name, or by the pose that it is part of.
"""

import copy
import math
from collections import deque
from collections.abc import Mapping, Sequence
from typing import NamedTuple, Self

from lockstep.protocol.description import Axis, BodyTwist, PlanarBase, RobotDescription
from lockstep.protocol.description import Pose as CommandedPose
from lockstep.protocol.messages import Feedback
from lockstep.server.scene.kinematics import (
    STILL,
    Pose,
    about,
    frame_pose,
    inverse,
    joined,
    product,
    rotate,
    world_poses,
)

__all__ = ["CommandedPath"]

MAX_RECORDS = 256  # more than a hold of 5 s has at any event rate that makes sense
MAX_COMMANDS = 512
Vector = tuple[float, float, float]


class _Record(NamedTuple):
    event: int
    time: float  # s, the bridge's
    joints: tuple[float, ...]
    at_rest: bool
    axes: tuple[float, ...]
    goals: tuple[float | None, ...]  # applied; empty without goal axes


class _Span(NamedTuple):
    """Values that were commanded for some time."""

    offsets: Mapping[str, float]  # of each axis from its rest value
    seconds: float


class _Goal(NamedTuple):
    value: float  # in the axis' unit
    offset: float  # from the measured value


class CommandedPath:
    """`command` takes a forwarded command, `feedback` a feedback; `poses` returns the commanded poses."""

    def __init__(self, description: RobotDescription) -> None:
        self.seconds = min(max(description.hold, 0.0), 5.0)
        self._description = description
        self._axes = [(axis.name, axis.rest if axis.kind == "rate" else None) for axis in description.axes]
        self._joints = [joint.name for joint in description.joints]
        self._gains = _gains(description)
        known = set(self._joints)
        base = description.planar_base
        self._base = base if base is not None and {base.x, base.y, base.yaw} <= known else None
        bodies = {body.name for body in description.bodies}
        self._twists = [each for each in description.body_twists if {each.body, each.frame} <= bodies | {""}]
        self._has_goal_joints = any(axis.kind == "goal" and axis.name in known for axis in description.axes)
        frames = bodies | {""} | {camera.name for camera in description.cameras if camera.calibration is not None}
        self._poses = [each for each in description.poses if each.body in bodies and each.frame in frames]
        self._commands: dict[int, tuple[float | None, ...]] = {}
        self._records: deque[_Record] = deque(maxlen=MAX_RECORDS)

    @property
    def known(self) -> bool:
        """True if the description tells the effect of any axis."""
        return bool(self._gains or self._base or self._twists or self._poses or self._has_goal_joints)

    def command(self, event: int, values: Sequence[float | None]) -> None:
        self._commands.pop(event, None)
        self._commands[event] = tuple(values)
        while len(self._commands) > MAX_COMMANDS:
            del self._commands[next(iter(self._commands))]

    def feedback(self, feedback: Feedback) -> None:
        if not all(map(math.isfinite, feedback.joints)) or not math.isfinite(feedback.time):
            return
        if self._records and feedback.time < self._records[-1].time:
            self._records.clear()
        at_rest = feedback.at_rest or feedback.stop.stopped
        joints, axes = tuple(feedback.joints), tuple(feedback.axes)
        self._records.append(_Record(feedback.event, feedback.time, joints, at_rest, axes, tuple(feedback.goals)))
        while len(self._records) > 1 and self._records[1].time <= feedback.time - self.seconds:
            self._records.popleft()

    def as_of_now(self) -> Self:
        """Return a copy for `poses` in another thread, which takes a while for a robot of many parts."""
        found = copy.copy(self)
        found._commands, found._records = dict(self._commands), self._records.copy()
        return found

    def poses(self) -> dict[str, Pose] | None:
        """Return the poses of all bodies in the world; None if nothing was commanded, or the description lacks data."""
        spans, goals = list(self._spans()), self._goals()
        if not self.known or not (goals or any(any(span.offsets.values()) for span in spans)):
            return None
        began = dict(zip(self._joints, self._records[0].joints, strict=False))
        joints = dict(zip(self._joints, self._records[-1].joints, strict=False))
        joints |= self._moved_joints(began, spans) | self._joints_at(goals, joints)
        poses = world_poses(self._description, joints)
        before = world_poses(self._description, began)
        for twist in self._twists:
            if twist.body in poses:
                poses[twist.body] = _moved_body(twist, before, poses, spans)
        self._put_tools(poses, goals)
        return poses

    def wanted(self, values: Sequence[float | None]) -> dict[str, Pose] | None:
        """Return the poses of all bodies where the goals among these values would bring them after the last feedback.

        None: there are none, or the description does not tell. A tool that is led by its pose is there, its arm is
        where it is.
        """
        axes = self._description.axes
        asked = any(value is not None and axis.kind == "goal" for axis, value in zip(axes, values, strict=False))
        if not self._records or not asked or not self.known:
            return None
        newest = self._records[-1]
        goals = self._goals_of(newest, values)
        joints = dict(zip(self._joints, newest.joints, strict=False))
        poses = world_poses(self._description, joints | self._joints_at(goals, joints))
        self._put_tools(poses, goals)
        return poses

    def _put_tools(self, poses: dict[str, Pose], goals: Mapping[str, _Goal]) -> None:
        """Put the bodies of tools where their goals are, as far as that is known."""
        for pose in self._poses:
            frame = frame_pose(self._description, pose.frame, poses)
            if frame is not None and any(name in goals for name in (*pose.position, *pose.rotation)):
                poses[pose.body] = _body_at(pose, frame, poses[pose.body], goals)

    def _spans(self) -> list[_Span]:
        """Return the commands between each feedback and the next."""
        records = list(self._records)
        return [
            _Span(self._offsets(record), min(after.time - record.time, self.seconds))
            for record, after in zip(records, records[1:], strict=False)
        ]

    def _offsets(self, record: _Record) -> dict[str, float]:
        values = self._commands.get(record.event)
        if record.at_rest or values is None:
            return {}
        return {
            name: value - rest
            for (name, rest), value in zip(self._axes, values, strict=False)
            if rest is not None and value is not None
        }

    def _goals(self) -> dict[str, _Goal]:
        """Return the goals of the newest command, and where the other goal axes stay; none at rest."""
        if not self._records or self._records[-1].at_rest:
            return {}
        newest = self._records[-1]
        return self._goals_of(newest, self._commands.get(newest.event, (None,) * len(self._axes)))

    def _goals_of(self, newest: _Record, asked: Sequence[float | None]) -> dict[str, _Goal]:
        """Return the goals of a command after this feedback."""
        axes = self._description.axes
        goals = {
            axis.name: _goal(axis, stays if value is None else value, measured)
            for axis, value, stays, measured in zip(axes, asked, newest.goals, newest.axes, strict=False)
            if axis.kind == "goal" and stays is not None
        }
        driven = {axis.name for axis, value in zip(axes, asked, strict=False) if value is not None}
        for pose in self._description.poses:  # its axes and those that it replaces say two things of the same joints
            own = {*pose.position, *pose.rotation}
            for name in pose.instead_of if driven & own else own:
                goals.pop(name, None)
        return goals

    def _joints_at(self, goals: Mapping[str, _Goal], joints: Mapping[str, float]) -> dict[str, float]:
        """Return the joints whose goal axes are known, with these goals reached."""
        found = {name: joints[name] + goal.offset for name, goal in goals.items() if name in joints}
        for joint, gains in self._gains.items():
            if joint in joints and gains.keys() & goals.keys():
                found[joint] = joints[joint] + sum(
                    gain * goals[axis].offset for axis, gain in gains.items() if axis in goals
                )
        return found

    def _moved_joints(self, began: Mapping[str, float], spans: list[_Span]) -> dict[str, float]:
        moved = {joint: began.get(joint, 0.0) for joint in self._gains}
        base = self._base
        place = None if base is None else tuple(began.get(name, 0.0) for name in (base.x, base.y, base.yaw))
        for offsets, seconds in spans:
            for joint, gains in self._gains.items():
                moved[joint] += seconds * sum(gain * offsets.get(axis, 0.0) for axis, gain in gains.items())
            if base is not None and place is not None:
                place = _moved_base(base, place, offsets, seconds)
        if base is not None and place is not None:
            moved |= dict(zip((base.x, base.y, base.yaw), place, strict=True))
        return moved


def _gains(description: RobotDescription) -> dict[str, dict[str, float]]:
    """Return the gains of axes by joint, for joints whose gains do not change with the posture."""
    joints = {joint.name for joint in description.joints}
    return {
        limit.joint: {each.axis: each.gain for each in limit.axes if each.gain is not None}
        for limit in description.position_limits
        if limit.joint in joints and all(each.gain is not None for each in limit.axes)
    }


def _moved_base(
    base: PlanarBase, place: tuple[float, ...], offsets: Mapping[str, float], seconds: float
) -> tuple[float, ...]:
    x, y, yaw = place
    forward, left, turn = (offsets.get(name, 0.0) * seconds for name in (base.forward, base.left, base.turn))
    heading = yaw + turn / 2  # of the arc's chord, nearly
    cos, sin = math.cos(heading), math.sin(heading)
    return (x + cos * forward - sin * left, y + sin * forward + cos * left, yaw + turn)


def _moved_body(twist: BodyTwist, before: Mapping[str, Pose], after: Mapping[str, Pose], spans: list[_Span]) -> Pose:
    """Return the commanded pose: from the body's pose in its frame at the first command, in its frame as of now."""
    here = Pose((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    pose = joined(inverse(before.get(twist.frame, here)), before[twist.body])
    point = joined(pose, Pose(twist.point, here.orientation)).position
    orientation = pose.orientation
    for offsets, seconds in spans:
        way = _vector(twist.linear, offsets, seconds)
        turn = _vector(twist.angular, offsets, seconds)
        point = (point[0] + way[0], point[1] + way[1], point[2] + way[2])
        orientation = product(about(turn, math.hypot(*turn)), orientation)
    x, y, z = rotate(orientation, twist.point)
    moved = Pose((point[0] - x, point[1] - y, point[2] - z), orientation)
    return joined(after.get(twist.frame, here), moved)


def _goal(axis: Axis, value: float, measured: float) -> _Goal:
    if axis.wrap:
        return _Goal(value, math.remainder(value - measured, axis.wrap))
    value = min(max(value, axis.minimum), axis.maximum)
    return _Goal(value, value - measured)


def _body_at(pose: CommandedPose, frame: Pose, measured: Pose, goals: Mapping[str, _Goal]) -> Pose:
    """Return the body at the goals of the pose's axes, in the world; it keeps what these do not say.

    `frame`: of the goals. `measured`: where the body is. Both in the world.
    """
    body = joined(inverse(frame), measured)
    point = joined(body, Pose(pose.point, STILL.orientation)).position
    x, y, z = (goals[name].value if name in goals else place for name, place in zip(pose.position, point, strict=True))
    orientation = body.orientation
    if all(name in goals for name in pose.rotation):
        turn = tuple(goals[name].value for name in pose.rotation)
        orientation = about((turn[0], turn[1], turn[2]), math.hypot(*turn))
    dx, dy, dz = rotate(orientation, pose.point)
    return joined(frame, Pose((x - dx, y - dy, z - dz), orientation))


def _vector(axes: tuple[str, str, str], offsets: Mapping[str, float], seconds: float) -> Vector:
    x, y, z = (offsets.get(name, 0.0) * seconds for name in axes)
    return (x, y, z)
