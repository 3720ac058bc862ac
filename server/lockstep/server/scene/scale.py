"""Scales robots for the 3D scene: magnifies those far smaller than a metre, shrinks those far larger than a hall.

viser's grid, camera and controls, and meshes in single precision, are made for metres. No I/O.
"""

import math
from collections.abc import Iterator

import msgspec

from lockstep.protocol.description import Body, Camera, Geofence, Geom, Joint, RangeRing, RobotDescription
from lockstep.protocol.messages import Feedback
from lockstep.server.scene.kinematics import Pose

__all__ = ["SceneScale"]

SMALLEST, LARGEST = 0.5, 100.0  # m, sizes of the whole scene that need no magnification
WANTED = 2.0  # m
BEYOND = 1e6  # m: a description that says more than this, or is not finite, is taken as it is
Triple = tuple[float, float, float]


class SceneScale:
    """One robot's magnification, a power of ten: `factor` is 1 for most.

    Only lengths grow. Angles, forces and names are as they were.
    """

    def __init__(self, description: RobotDescription) -> None:
        self.factor = _factor(max(_reaches(description), default=1.0))
        self._in_metres = [joint.unit == "m" for joint in description.joints]
        self._goals_in_metres = [axis.unit == "m" for axis in description.axes]

    def description(self, description: RobotDescription) -> RobotDescription:
        """Return the same robot, magnified by `factor`."""
        if self.factor == 1.0:
            return description
        by = self.factor
        return msgspec.structs.replace(
            description,
            bodies=tuple(_body(body, by) for body in description.bodies),
            joints=tuple(_joint(joint, by) for joint in description.joints),
            ranges=None if description.ranges is None else _ring(description.ranges, by),
            poses=tuple(msgspec.structs.replace(pose, point=_times(pose.point, by)) for pose in description.poses),
            cameras=tuple(_camera(camera, by) for camera in description.cameras),
            geofences=tuple(_fence(fence, by) for fence in description.geofences),
            body_twists=tuple(
                msgspec.structs.replace(twist, point=_times(twist.point, by)) for twist in description.body_twists
            ),
        )

    def feedback(self, feedback: Feedback) -> Feedback:
        """Return the feedback of the magnified robot."""
        if self.factor == 1.0:
            return feedback
        joints = [
            value * self.factor if metres else value
            for value, metres in zip(feedback.joints, self._in_metres, strict=False)
        ]
        goals = [
            value * self.factor if metres and value is not None else value
            for value, metres in zip(feedback.goals, self._goals_in_metres, strict=False)
        ]
        ranges = [value * self.factor for value in feedback.ranges]
        return msgspec.structs.replace(feedback, joints=joints, goals=goals, ranges=ranges)

    def poses(self, poses: dict[str, Pose] | None) -> dict[str, Pose] | None:
        """Return the poses of the magnified robot, from those of the robot as it is."""
        if poses is None or self.factor == 1.0:
            return poses
        return {name: _magnified(pose, self.factor) for name, pose in poses.items()}


def _magnified(pose: Pose, by: float) -> Pose:
    return Pose(_times(pose.position, by), pose.orientation)


def _factor(reach: float) -> float:
    if SMALLEST <= reach <= LARGEST or not 0.0 < reach < BEYOND:
        return 1.0
    return float(10.0 ** round(math.log10(WANTED / reach)))


def _reaches(description: RobotDescription) -> Iterator[float]:
    """Yield the reach of all parts from their body's parent; a robot is about as large as the largest of these."""
    for body in description.bodies:
        yield math.hypot(*body.position)
        for geom in body.geoms:
            yield math.hypot(*geom.position) + 2.0 * max(map(abs, (*geom.size, *geom.vertices)))


def _body(body: Body, by: float) -> Body:
    return msgspec.structs.replace(
        body, position=_times(body.position, by), geoms=tuple(_geom(geom, by) for geom in body.geoms)
    )


def _geom(geom: Geom, by: float) -> Geom:
    return msgspec.structs.replace(
        geom,
        size=_times(geom.size, by),
        position=_times(geom.position, by),
        vertices=tuple(value * by for value in geom.vertices),
    )


def _joint(joint: Joint, by: float) -> Joint:
    if joint.unit != "m":
        return joint
    low, high = (None if bound is None else bound * by for bound in (joint.minimum, joint.maximum))
    return msgspec.structs.replace(joint, minimum=low, maximum=high)


def _camera(camera: Camera, by: float) -> Camera:
    if camera.calibration is None:
        return camera
    view = msgspec.structs.replace(camera.calibration, position=_times(camera.calibration.position, by))
    return msgspec.structs.replace(camera, calibration=view)


def _ring(ring: RangeRing, by: float) -> RangeRing:
    return msgspec.structs.replace(ring, range_min=ring.range_min * by, range_max=ring.range_max * by)


def _fence(fence: Geofence, by: float) -> Geofence:
    return msgspec.structs.replace(fence, polygon=tuple((x * by, y * by) for x, y in fence.polygon))


def _times(vector: Triple, by: float) -> Triple:
    x, y, z = vector
    return (x * by, y * by, z * by)
