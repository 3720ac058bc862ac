"""Finds the calibration of a camera: the pinhole by its CameraInfo, its place by the URDF and static frames of TF."""

from lockstep.robot_bridge.robots.ros2.discovery.drafting.yaml_text import Plain
from lockstep.robot_bridge.robots.ros2.discovery.graph import Graph, Topic, parts_of_name
from lockstep.robot_bridge.robots.ros2.discovery.message_kinds import CAMERA_INFO
from lockstep.robot_bridge.robots.ros2.discovery.pose import Pose
from lockstep.robot_bridge.robots.ros2.discovery.urdf import Urdf
from lockstep.robot_bridge.robots.ros2.pinhole import Pinhole, is_rectified

__all__ = ["Places", "calibration", "info_topic"]

INFO = "camera_info"
COMPRESSED = "compressed"
DIGITS = 6
SHARES = 0.02  # by which the two scales of a picture may differ: another share of the sensor is not known
MAX_STEPS = 64


class Places:
    """Where the frames of cameras are on the bodies of the robot's file."""

    def __init__(self, graph: Graph, urdf: Urdf | None, bodies: dict[str, str], joints: set[str], root: str) -> None:
        """`bodies`: names of the file's bodies by their links.

        `joints`: those that the description has; a link behind another one that moves has no known place.
        `root`: the body on which the robot stands, "" the world.
        """
        self._mounts = graph.mounts
        self._urdf = urdf
        self._bodies = bodies
        self._joints = joints
        self._root = root

    def of(self, frame: str) -> tuple[str, Pose] | None:
        """Return the body that a frame is fixed to, and its pose there; None if that is not known."""
        pose = Pose()
        name = frame.lstrip("/")
        for _ in range(MAX_STEPS):
            if name in self._bodies:
                return (self._bodies[name], pose) if self._is_followed(name) else None
            if self._urdf is not None and name == self._urdf.root:
                return self._root, pose
            step = self._above(name)
            if step is None:
                return None
            name, pose = step[0], step[1].then(pose)
        return None

    def _above(self, name: str) -> tuple[str, Pose] | None:
        """Return the frame that a frame is fixed to."""
        if self._urdf is not None and name in self._urdf.links:
            joint = self._urdf.chain(name)[-1]  # its root has been found before
            return (joint.parent, joint.pose) if joint.kind == "fixed" else None
        mount = self._mounts.get(name)
        return None if mount is None else (mount[0], mount[1])

    def _is_followed(self, link: str) -> bool:
        """Whether the description has every joint that moves the link."""
        chain = [] if self._urdf is None else self._urdf.chain(link)
        return all(joint.kind == "fixed" or joint.name in self._joints for joint in chain)


def info_topic(pictures: str) -> str:
    """Return the topic of CameraInfo beside a topic of pictures."""
    parts = parts_of_name(pictures.removesuffix(f"/{COMPRESSED}"))
    return "/" + "/".join([*parts[:-1], INFO])


def calibration(graph: Graph, topic: Topic, width: int, height: int, places: Places) -> dict[str, Plain] | str:
    """Return the setting of a camera, or why there is none: "" if it has no CameraInfo."""
    info = info_topic(topic.name)
    if info not in graph.topics or not graph.topics[info].publishes(CAMERA_INFO):
        return ""
    pinhole = graph.said(info).pinhole
    if pinhole is None:
        return f"{info} says no calibration that can be used"
    scale = width / pinhole.width
    if abs(height / pinhole.height / scale - 1) > SHARES:
        return f"{info} is of another shape than the pictures"
    frame = pinhole.frame or graph.said(topic.name).frame
    place = places.of(frame)
    if place is None:
        return (
            f"{info}: where the frame {frame!r} is fixed to the robot is not known, so nothing is drawn on its pictures"
        )
    return _setting(pinhole, is_rectified(topic.name) and pinhole.rectified[0] > 0, scale, place)


def _setting(pinhole: Pinhole, is_rectified: bool, scale: float, place: tuple[str, Pose]) -> dict[str, Plain]:
    fx, fy, cx, cy = (round(value * scale, 3) for value in (pinhole.rectified if is_rectified else pinhole.raw))
    setting: dict[str, Plain] = {"fx": fx, "fy": fy, "cx": cx, "cy": cy}
    if pinhole.distortion and not is_rectified:
        setting |= {"distortion_model": pinhole.distortion_model, "distortion": list(pinhole.distortion)}
    body, pose = place
    setting["body"] = body
    setting["position"] = [round(value, DIGITS) + 0.0 for value in pose.position]
    setting["orientation"] = [round(value, DIGITS) + 0.0 for value in pose.orientation]
    return setting
