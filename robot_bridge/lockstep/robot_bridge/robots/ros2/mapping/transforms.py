"""Planar poses of frames in each other, from tf2_msgs/TFMessage. No I/O, no clock: the caller hands in `now`."""

import math
from typing import Any, NamedTuple

from lockstep.robot_bridge.robots.navigation import PlanarPose

__all__ = ["TransformTree", "composed", "inverted", "planar"]

MAX_FRAMES = 1024  # a robot has some dozens; further ones are not kept
MAX_STEPS = 64  # from a frame to its root
MAX_NAME = 200


class _Edge(NamedTuple):
    parent: str
    pose: PlanarPose  # of the child in the parent
    time: float  # s, when it came; inf for a static one


class TransformTree:
    """One thread puts transforms in, another looks poses up: each edge is replaced as a whole."""

    def __init__(self) -> None:
        self._edges: dict[str, _Edge] = {}  # by child

    def take(self, message: Any, now: float, *, static: bool) -> None:
        """Keep the transforms of a message; those that make no sense are left out."""
        for each in message.transforms:
            parent, child = each.header.frame_id.lstrip("/"), each.child_frame_id.lstrip("/")
            if not parent or not child or parent == child or max(len(parent), len(child)) > MAX_NAME:
                continue
            if child not in self._edges and len(self._edges) >= MAX_FRAMES:
                continue
            pose = planar(each.transform.translation, each.transform.rotation)
            if pose is not None:
                self._edges[child] = _Edge(parent, pose, math.inf if static else now)

    def pose(self, frame: str, child: str, now: float, timeout: float) -> PlanarPose | None:
        """Return the pose of `child` in `frame`.

        None if they are not connected, or a transform between them came longer than `timeout` ago. Tilted frames are
        taken for their turn about the vertical.
        """
        up, down = self._chain(child), self._chain(frame)
        root = next((name for name in up if name in down), None)
        if root is None:
            return None
        of_child, of_frame = self._along(up, root, now, timeout), self._along(down, root, now, timeout)
        if of_child is None or of_frame is None:
            return None
        return composed(inverted(of_frame), of_child)

    def _chain(self, frame: str) -> list[str]:
        names = [frame.lstrip("/")]
        while (edge := self._edges.get(names[-1])) is not None and len(names) < MAX_STEPS:
            if edge.parent in names:
                break
            names.append(edge.parent)
        return names

    def _along(self, names: list[str], root: str, now: float, timeout: float) -> PlanarPose | None:
        pose: PlanarPose = (0.0, 0.0, 0.0)
        for name in names[: names.index(root)]:
            edge = self._edges[name]
            if now - edge.time > timeout:
                return None
            pose = composed(edge.pose, pose)
        return pose


def planar(position: Any, turn: Any) -> PlanarPose | None:
    """Return a pose of geometry_msgs without its height and tilt; None if it is none."""
    length = turn.w * turn.w + turn.x * turn.x + turn.y * turn.y + turn.z * turn.z
    if not 0.5 < length < 2.0:  # also false for NaN
        return None
    sine = 2 * (turn.w * turn.z + turn.x * turn.y) / length
    cosine = 1 - 2 * (turn.y * turn.y + turn.z * turn.z) / length
    pose = (float(position.x), float(position.y), math.atan2(sine, cosine))
    return pose if all(map(math.isfinite, pose)) else None


def composed(outer: PlanarPose, inner: PlanarPose) -> PlanarPose:
    """Return the pose `inner`, given in the frame `outer`, in the frame in which `outer` is given."""
    cos, sin = math.cos(outer[2]), math.sin(outer[2])
    return (
        outer[0] + cos * inner[0] - sin * inner[1],
        outer[1] + sin * inner[0] + cos * inner[1],
        math.remainder(outer[2] + inner[2], math.tau),
    )


def inverted(pose: PlanarPose) -> PlanarPose:
    """Return the pose of the outer frame in the inner one."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    return (-cos * pose[0] - sin * pose[1], sin * pose[0] - cos * pose[1], -pose[2])
