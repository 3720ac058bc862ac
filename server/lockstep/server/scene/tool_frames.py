"""Draws the frames of a robot's tools in the 3D scene: as measured, and where they are to be."""

import math
from collections.abc import Mapping, Sequence

import viser

from lockstep.protocol.description import Pose as ToolPose
from lockstep.protocol.description import RobotDescription
from lockstep.protocol.messages import Feedback
from lockstep.server.scene.kinematics import STILL, Pose, about, frame_pose, inverse, joined

__all__ = ["SceneTools", "goal_pose", "tool_place"]

AXIS = 0.16  # of the robot's radius
THICK = 0.05  # of an axis' length
SAME_PLACE = 0.003  # m
SAME_TURN = math.cos(0.02)  # of half the angle


def tool_place(pose: ToolPose, bodies: Mapping[str, Pose]) -> Pose | None:
    """Return where a tool is in the world; None if there is no such body."""
    body = bodies.get(pose.body)
    return None if body is None else joined(body, Pose(pose.point, STILL.orientation))


def goal_pose(
    description: RobotDescription, pose: ToolPose, goals: Sequence[float | None], bodies: Mapping[str, Pose]
) -> Pose | None:
    """Return where a tool is to be in the world; None where that is not known."""
    values = {axis.name: goal for axis, goal in zip(description.axes, goals, strict=False)}
    place, turn = ([values.get(name) for name in names] for names in (pose.position, pose.rotation))
    frame, measured = frame_pose(description, pose.frame, bodies), tool_place(pose, bodies)
    x, y, z = place
    if frame is None or measured is None or x is None or y is None or z is None:
        return None
    rx, ry, rz = turn
    if rx is None or ry is None or rz is None:  # it turns as it was measured
        return Pose(joined(frame, Pose((x, y, z), STILL.orientation)).position, measured.orientation)
    return joined(frame, Pose((x, y, z), about((rx, ry, rz), math.hypot(rx, ry, rz))))


class SceneTools:
    """Two frames for each tool. The goal's shows only while it is somewhere else."""

    def __init__(self, server: viser.ViserServer, description: RobotDescription, radius: float, factor: float) -> None:
        """`factor`: by which the robot is magnified."""
        self._description = description
        self._same = SAME_PLACE * factor
        length = AXIS * radius
        self.frames = [
            (
                pose,
                server.scene.add_frame(
                    f"/tools/{number}/measured",
                    visible=False,
                    axes_length=length,
                    axes_radius=THICK * length,
                    origin_radius=0.0,
                ),
                server.scene.add_frame(
                    f"/tools/{number}/goal",
                    visible=False,
                    axes_length=length,
                    axes_radius=THICK * length / 2,
                    origin_radius=2 * THICK * length,
                    origin_color=(255, 194, 77),
                ),
            )
            for number, pose in enumerate(description.poses)
        ]

    def show(self, feedback: Feedback, bodies: Mapping[str, Pose]) -> None:
        """Show a feedback. `bodies`: where its joints have them."""
        known = not {joint.name for joint in self._description.joints} & set(feedback.unknown)
        for pose, measured, goal in self.frames:
            place = tool_place(pose, bodies) if known else None
            aim = goal_pose(self._description, pose, feedback.goals, bodies) if known else None
            _put(measured, place)
            _put(goal, None if aim is None or (place is not None and _same(aim, place, self._same)) else aim)


def _put(frame: viser.FrameHandle, pose: Pose | None) -> None:
    if pose is not None:
        frame.position, frame.wxyz = pose.position, pose.orientation
    if frame.visible != (pose is not None):
        frame.visible = pose is not None


def _same(one: Pose, other: Pose, place: float) -> bool:
    between = joined(inverse(one), other)
    return math.hypot(*between.position) < place and abs(between.orientation[0]) > SAME_TURN
