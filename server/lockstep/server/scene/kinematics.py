"""Poses of a robot's bodies from its joint values, by its description. No I/O."""

import math
from collections.abc import Mapping
from typing import NamedTuple

from lockstep.protocol.description import Body, BodyJoint, RobotDescription

__all__ = [
    "STILL",
    "Pose",
    "about",
    "body_pose",
    "frame_pose",
    "inverse",
    "joined",
    "product",
    "rotate",
    "scene_paths",
    "world_poses",
    "world_positions",
]

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]  # w, x, y, z


class Pose(NamedTuple):
    """The pose of a body in its parent, or in the world."""

    position: Vector
    orientation: Quaternion


STILL = Pose((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))


def body_pose(body: Body, joints: Mapping[str, float]) -> Pose:
    """Return the pose in the parent. The body's joints act in list order, in its frame, after its fixed pose."""
    pose = Pose(body.position, body.orientation)
    for joint in body.joints:
        pose = _moved(pose, joint, joints.get(joint.joint, 0.0))
    return pose


def frame_pose(description: RobotDescription, name: str, bodies: Mapping[str, Pose]) -> Pose | None:
    """Return where the frame of a body or camera is in the world; "": the world's. None where that is not known.

    `bodies`: in the world.
    """
    if not name or name in bodies:
        return bodies.get(name, STILL)
    view = next((each.calibration for each in description.cameras if each.name == name), None)
    if view is None:
        return None
    body = bodies.get(view.body) if view.body else STILL
    length = math.hypot(*view.orientation)
    if body is None or not 0.0 < length < math.inf:
        return None
    w, x, y, z = view.orientation
    return joined(body, Pose(view.position, (w / length, x / length, y / length, z / length)))


def scene_paths(description: RobotDescription) -> dict[str, str]:
    """Return the path of every body in the scene tree, "/robot/base/arm": parents first, no orphans."""
    parents = {body.name: body.parent for body in description.bodies}
    paths: dict[str, str] = {}
    for body in description.bodies:
        chain, name = list[str](), body.name  # bodies whose path is not known yet: each is looked at once
        while name in parents and name not in paths and len(chain) <= len(parents):
            chain.append(name)
            name = parents[name]
        if name == "" or name in paths:
            for each in reversed(chain):
                paths[each] = f"{paths.get(parents[each], '/robot')}/{each.replace('/', '_')}"
    found = {body.name: paths[body.name] for body in description.bodies if body.name in paths}
    return dict(sorted(found.items(), key=lambda item: item[1].count("/")))


def world_positions(description: RobotDescription, joints: Mapping[str, float]) -> list[Vector]:
    """Return the bodies' positions in the world, in the order of `scene_paths`."""
    return [pose.position for pose in world_poses(description, joints).values()]


def world_poses(description: RobotDescription, joints: Mapping[str, float]) -> dict[str, Pose]:
    """Return the bodies' poses in the world, in the order of `scene_paths`."""
    bodies = {body.name: body for body in description.bodies}
    world = Pose((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    poses: dict[str, Pose] = {}
    for name in scene_paths(description):
        parent = poses.get(bodies[name].parent, world)
        poses[name] = joined(parent, body_pose(bodies[name], joints))
    return poses


def joined(outer: Pose, inner: Pose) -> Pose:
    """Return `inner`, which is given in `outer`, in the frame of `outer`."""
    position = _added(outer.position, rotate(outer.orientation, inner.position))
    return Pose(position, product(outer.orientation, inner.orientation))


def inverse(pose: Pose) -> Pose:
    """Return the inverse of a pose of unit orientation."""
    w, x, y, z = pose.orientation
    back = (w, -x, -y, -z)
    at_x, at_y, at_z = rotate(back, pose.position)
    return Pose((-at_x, -at_y, -at_z), back)


def _moved(pose: Pose, joint: BodyJoint, value: float) -> Pose:
    if joint.kind == "prismatic":
        x, y, z = joint.axis
        return Pose(
            _added(pose.position, rotate(pose.orientation, (x * value, y * value, z * value))), pose.orientation
        )
    return Pose(pose.position, product(pose.orientation, about(joint.axis, value)))


def about(axis: Vector, angle: float) -> Quaternion:
    """Return a turn about `axis`, which need not be of length 1; about a zero axis it is no turn."""
    largest = max(map(abs, axis))
    if largest == 0:
        return (1.0, 0.0, 0.0, 0.0)
    x, y, z = (value / largest for value in axis)  # first: one over a tiny length would be infinite
    sine = math.sin(angle / 2) / math.hypot(x, y, z)
    return (math.cos(angle / 2), x * sine, y * sine, z * sine)


def product(a: Quaternion, b: Quaternion) -> Quaternion:
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    )


def rotate(quaternion: Quaternion, vector: Vector) -> Vector:
    w, x, y, z = quaternion
    _, rx, ry, rz = product(product(quaternion, (0.0, *vector)), (w, -x, -y, -z))
    return (rx, ry, rz)


def _added(a: Vector, b: Vector) -> Vector:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])
