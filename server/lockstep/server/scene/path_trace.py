"""The robot's trails in the 3D scene: lines behind its base and its tool. Runs in the scene's own thread."""

from collections import deque
from collections.abc import Mapping

import numpy as np
import viser

from lockstep.protocol.description import RobotDescription
from lockstep.server.scene.kinematics import Pose, joined, scene_paths

__all__ = ["SceneTrails"]

CHUNK = 32  # points of one line; only the last line changes
CHUNKS = 16  # lines of a trail, the newest
BASE, TOOL = (124, 188, 255), (255, 194, 77)
Vector = tuple[float, float, float]


class SceneTrails:
    """Trails of the first moving body, and of the body that a twist moves, else of the outermost body."""

    def __init__(self, server: viser.ViserServer, description: RobotDescription, step: float) -> None:
        paths = scene_paths(description)
        moving = sorted(
            (paths[body.name], body.name) for body in description.bodies if body.joints and body.name in paths
        )
        moving.sort(key=lambda each: each[0].count("/"))
        self._trails: dict[str, _Trail] = {}
        self._points: dict[str, Vector] = {}
        if not moving:
            return
        base, tool = moving[0][1], moving[-1][1]
        point = (0.0, 0.0, 0.0)
        for twist in description.body_twists[:1]:
            if twist.body in paths:
                tool, point = twist.body, twist.point
        for name, color, where in ((base, BASE, (0.0, 0.0, 0.0)), (tool, TOOL, point)):
            if name not in self._trails:
                self._trails[name] = _Trail(server, f"/trail/{len(self._trails)}", color, step)
                self._points[name] = where

    def follow(self, poses: Mapping[str, Pose]) -> None:
        for name, trail in self._trails.items():
            trail.add(joined(poses[name], Pose(self._points[name], (1.0, 0.0, 0.0, 0.0))).position)

    def lengths(self) -> list[int]:
        """Return the number of points of each trail."""
        return [trail.length for trail in self._trails.values()]


class _Trail:
    def __init__(self, server: viser.ViserServer, path: str, color: tuple[int, int, int], step: float) -> None:
        self._server = server
        self._path = path
        self._color = color
        self._step = step
        self._lines: deque[viser.LineSegmentsHandle] = deque()
        self._points: list[Vector] = []  # of the last line
        self._made = 0

    @property
    def length(self) -> int:
        return max(0, len(self._lines) - 1) * CHUNK + len(self._points)

    def add(self, point: Vector) -> None:
        """Add a point, unless it lies nearer than a step to the last one."""
        if self._points and float(np.linalg.norm(np.subtract(point, self._points[-1]))) < self._step:
            return
        if len(self._points) >= CHUNK:
            self._points = self._points[-1:]
            self._made += 1
        self._points.append(point)
        if len(self._points) < 2:
            return
        points = np.array(self._points, np.float32)
        segments = np.stack((points[:-1], points[1:]), axis=1)
        if len(self._points) == 2:
            self._begin(segments)
        else:
            self._lines[-1].points = segments

    def _begin(self, segments: np.typing.NDArray[np.float32]) -> None:
        line = self._server.scene.add_line_segments(
            f"{self._path}/{self._made}", segments, self._color, thickness=2.0, thickness_units="screen"
        )
        self._lines.append(line)
        if len(self._lines) > CHUNKS:
            self._lines.popleft().remove()
