"""Poses and shapes of the robot's bodies in Foxglove's schemas. No I/O, no clock; times in ns since 1970.

Each body is a frame with the body's name in its parent's, as in the robot description; bodies without a parent are in
the frame WORLD. The frames of bodies on joints come with each feedback, the others, and the shapes, once.
"""

from collections.abc import Iterable, Iterator, Mapping

from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.CubePrimitive_pb2 import CubePrimitive
from foxglove_schemas_protobuf.CylinderPrimitive_pb2 import CylinderPrimitive
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.Odometry_pb2 import Odometry
from foxglove_schemas_protobuf.Point3_pb2 import Point3
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneEntityDeletion_pb2 import SceneEntityDeletion
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.SpherePrimitive_pb2 import SpherePrimitive
from foxglove_schemas_protobuf.TriangleListPrimitive_pb2 import TriangleListPrimitive
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.timestamp_pb2 import Timestamp

from lockstep.protocol.description import Body, Camera, Geom, PlanarBase, RobotDescription
from lockstep.protocol.description import CameraCalibration as Calibration
from lockstep.server.scene.kinematics import Pose as BodyPose
from lockstep.server.scene.kinematics import body_pose, joined

__all__ = [
    "WORLD",
    "base_body",
    "camera_calibration",
    "camera_frames",
    "fixed_transforms",
    "moving_transforms",
    "odometry",
    "robot_shapes",
]

WORLD = "world"  # frame of bodies without a parent, and of the base's pose
SECOND = 1_000_000_000
UPRIGHT = (1.0, 0.0, 0.0, 0.0)


def moving_transforms(description: RobotDescription, joints: Mapping[str, float], captured: int) -> bytes:
    """Return FrameTransforms of the bodies on joints."""
    return _transforms((each for each in description.bodies if each.joints), joints, captured)


def fixed_transforms(description: RobotDescription, captured: int) -> bytes:
    """Return FrameTransforms of the bodies without joints, and of the cameras whose place is known.

    A camera's frame is its optical one and has the camera's name, as its pictures say; a body of that name goes first.
    """
    fixed = [each for each in description.bodies if not each.joints]
    return _transforms([*fixed, *camera_frames(description)], {}, captured)


def camera_frames(description: RobotDescription) -> Iterator[Body]:
    """Yield the optical frames of the cameras whose place is known, as bodies."""
    taken = {WORLD, *(each.name for each in description.bodies)}
    for camera in description.cameras:
        at = camera.calibration
        if at is not None and camera.name not in taken:
            yield Body(name=camera.name, parent=at.body, position=at.position, orientation=at.orientation)


def camera_calibration(camera: Camera, found: Calibration, captured: int) -> bytes:
    """Return the CameraCalibration of a camera for its full size, in its own frame."""
    message = CameraCalibration(
        timestamp=_stamp(captured),
        frame_id=camera.name,
        width=camera.width,
        height=camera.height,
        distortion_model=found.distortion_model,
        D=found.distortion,
        K=(found.fx, 0.0, found.cx, 0.0, found.fy, found.cy, 0.0, 0.0, 1.0),
        R=(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
        P=(found.fx, 0.0, found.cx, 0.0, 0.0, found.fy, found.cy, 0.0, 0.0, 0.0, 1.0, 0.0),
    )
    return message.SerializeToString()


def _transforms(bodies: Iterable[Body], joints: Mapping[str, float], captured: int) -> bytes:
    stamp = _stamp(captured)
    found = FrameTransforms()
    for body in bodies:
        parent = body.parent or WORLD
        if body.name == parent:
            continue  # a frame in itself: viewers would refuse the whole tree
        pose = body_pose(body, joints)
        found.transforms.append(
            FrameTransform(
                timestamp=stamp,
                parent_frame_id=parent,
                child_frame_id=body.name,
                translation=_vector(pose.position),
                rotation=_rotation(pose.orientation),
            )
        )
    return found.SerializeToString()


def robot_shapes(description: RobotDescription, captured: int) -> bytes:
    """Return a SceneUpdate that replaces everything by the bodies' shapes, each fixed to its body's frame."""
    stamp = _stamp(captured)
    update = SceneUpdate(deletions=[SceneEntityDeletion(timestamp=stamp, type=SceneEntityDeletion.ALL)])
    for body in description.bodies:
        if body.geoms:
            entity = SceneEntity(timestamp=stamp, frame_id=body.name, id=body.name, frame_locked=True)
            for geom in body.geoms:
                _add_shape(entity, geom)
            update.entities.append(entity)
    return update.SerializeToString()


def _add_shape(entity: SceneEntity, geom: Geom) -> None:
    at = BodyPose(geom.position, geom.orientation)
    color = Color(r=geom.rgba[0], g=geom.rgba[1], b=geom.rgba[2], a=geom.rgba[3])
    if geom.shape == "mesh":
        points = [Point3(x=x, y=y, z=z) for x, y, z in zip(*(geom.vertices[at::3] for at in range(3)), strict=True)]
        entity.triangles.append(
            TriangleListPrimitive(pose=_pose(at), points=points, color=color, indices=geom.triangles)
        )
        return
    first, second, third = (2 * each for each in geom.size)
    if geom.shape == "box":
        size = Vector3(x=first, y=second, z=third)
        entity.cubes.append(CubePrimitive(pose=_pose(at), size=size, color=color))
        return
    around = Vector3(x=first, y=first, z=first)
    if geom.shape == "sphere":
        entity.spheres.append(SpherePrimitive(pose=_pose(at), size=around, color=color))
        return
    size = Vector3(x=first, y=first, z=second)
    entity.cylinders.append(CylinderPrimitive(pose=_pose(at), size=size, bottom_scale=1, top_scale=1, color=color))
    if geom.shape == "capsule":  # Foxglove has none: a cylinder, and a sphere at each of its ends
        for end in (-second / 2, second / 2):
            cap = joined(at, BodyPose((0.0, 0.0, end), UPRIGHT))
            entity.spheres.append(SpherePrimitive(pose=_pose(cap), size=around, color=color))


def odometry(description: RobotDescription, base: PlanarBase, pose: Pose, axes: list[float], captured: int) -> bytes:
    """Return an Odometry of the base: its pose in WORLD, and its measured twist in its own frame."""
    values = dict(zip((axis.name for axis in description.axes), axes, strict=False))
    found = Odometry(
        timestamp=_stamp(captured),
        frame_id=WORLD,
        body_frame_id=base_body(description, base),
        pose=pose,
        linear_velocity=Vector3(x=values.get(base.forward, 0.0), y=values.get(base.left, 0.0)),
        angular_velocity=Vector3(z=values.get(base.turn, 0.0)),
    )
    return found.SerializeToString()


def base_body(description: RobotDescription, base: PlanarBase) -> str:
    """Return the name of the body that turns with the base; "" if no body does."""
    return next((body.name for body in description.bodies for joint in body.joints if joint.joint == base.yaw), "")


def _pose(pose: BodyPose) -> Pose:
    return Pose(position=_vector(pose.position), orientation=_rotation(pose.orientation))


def _vector(vector: tuple[float, float, float]) -> Vector3:
    return Vector3(x=vector[0], y=vector[1], z=vector[2])


def _rotation(quaternion: tuple[float, float, float, float]) -> Quaternion:
    return Quaternion(w=quaternion[0], x=quaternion[1], y=quaternion[2], z=quaternion[3])


def _stamp(time: int) -> Timestamp:
    return Timestamp(seconds=time // SECOND, nanos=time % SECOND)
