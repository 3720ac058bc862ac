"""Builds a robot in viser from its description, and poses it from feedback. Runs in the scene's own thread."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
import viser

from lockstep.protocol.description import Body, RobotDescription
from lockstep.protocol.messages import Feedback
from lockstep.server.scene.commanded_pose import SceneGhost
from lockstep.server.scene.geofences import SceneFences
from lockstep.server.scene.kinematics import (
    Pose,
    body_pose,
    inverse,
    joined,
    scene_paths,
    world_poses,
    world_positions,
)
from lockstep.server.scene.path_trace import SceneTrails
from lockstep.server.scene.shadows.ghosts import SceneShadows
from lockstep.server.scene.shapes import add_geom
from lockstep.server.scene.tool_frames import SceneTools

__all__ = ["SceneModel", "length_words"]

BACKGROUND = (16, 20, 26)
GRID = (44, 52, 64)
GRID_SECTION = (66, 78, 94)
ARROW = (255, 176, 32)
RANGES = (64, 200, 255)
LABEL_LIFT = 0.4  # m above the highest joint
FLOOR_LIFT = 0.004  # m, so that the grid shows on a floor in the robot's description
STOPPED = " · STOPPED"
CELL = 0.5  # m, of the grid
TRAIL_STEP = 0.004  # of the radius of the scene
RAY = (40, 92, 122)
GHOST_APART = 0.008  # of the radius of the scene: nearer than this the ghost is not drawn
ARROW_LEAST = 0.15  # m, so that a light contact shows
ARROW_LENGTH = 0.6  # m at full scale
USUAL_VIEW = 1.6  # m, distance of the first view of a robot whose bodies have no places of their own
MIN_VIEW, MAX_VIEW = 0.5, 6.0  # m, of the others: an arm on a table is seen from near
UPRIGHT = (1.0, 0.0, 0.0, 0.0)  # quaternion, w first

Triple = tuple[float, float, float]


class SceneModel:
    """One robot in one viser server. `pose` sets only what changed.

    `factor` is the magnification of the description.
    """

    def __init__(self, server: viser.ViserServer, description: RobotDescription, factor: float = 1.0) -> None:
        self._server = server
        self._description = description
        self._paths = scene_paths(description)
        self._joint_names = [joint.name for joint in description.joints]
        self._build_surroundings(factor)
        self.frames = {
            body.name: server.scene.add_frame(self._paths[body.name], show_axes=False)
            for body in sorted(description.bodies, key=lambda body: self._paths.get(body.name, "").count("/"))
            if body.name in self._paths
        }
        for body in description.bodies:
            for number, geom in enumerate(body.geoms if body.name in self._paths else ()):
                add_geom(server, f"{self._paths[body.name]}/geom{number}", geom)
        self._moving = [body for body in description.bodies if body.joints and body.name in self._paths]
        self._place_fixed_bodies()
        self.label = self._add_label()
        self.arrow = self._add_arrow()
        self.points = self._add_points()
        self.rays = self._add_rays()
        self.ghost = SceneGhost(
            server, description, self._radius() * GHOST_APART, label=f"commanded, last {description.hold:.2g} s"
        )
        self.trails = SceneTrails(server, description, self._radius() * TRAIL_STEP)
        self.fences = SceneFences(server, description)
        self.tools = SceneTools(server, description, self._radius(), factor)
        self.shadows = SceneShadows(server, description, self._radius(), self._radius() * GHOST_APART)

    def pose(
        self,
        feedback: Feedback,
        commanded: Mapping[str, Pose] | None = None,
        shadows: Sequence[tuple[str, Mapping[str, Pose]]] = (),
    ) -> None:
        """Show a feedback. `commanded`: poses of the bodies by the commands alone; None: nothing is commanded.

        `shadows`: the policies that do not drive, by name, and where each wants the bodies.
        """
        joints = dict(zip(self._joint_names, feedback.joints, strict=False))
        with self._server.atomic():
            # First: viewers hold back all that follows until they show a picture of this event (web's scene_gate.ts).
            self.label.text = f"s {feedback.event}{STOPPED if feedback.stop.stopped else ''}"
            for body in self._moving:
                frame, pose = self.frames[body.name], body_pose(body, joints)
                frame.position, frame.wxyz = pose.position, pose.orientation
            self._pose_arrow(feedback.wrench)
            self._pose_points(feedback.ranges)
            self.fences.show(feedback.limits)
            measured = world_poses(self._description, joints)
            self.ghost.show(commanded, measured)
            self.trails.follow(measured)
            self.tools.show(feedback, measured)
            self.shadows.show(shadows, measured)

    def _build_surroundings(self, factor: float) -> None:
        scene, camera = self._server.scene, self._server.initial_camera
        scene.set_background_image(np.full((2, 2, 3), BACKGROUND, dtype=np.uint8), format="png")
        scene.add_grid(
            "/floor",
            width=20.0,
            height=20.0,
            cell_size=CELL,
            section_size=1.0,
            cell_color=GRID,
            section_color=GRID_SECTION,
            fade_distance=14.0,
            position=(0.0, 0.0, FLOOR_LIFT),
        )
        x, y, z = self._center()
        scene.add_label(
            "/floor/scale",
            f"small square: {length_words(CELL / factor)}",
            position=(x + self._radius() * 0.8, y - self._radius() * 0.8, FLOOR_LIFT),
            font_screen_scale=0.9,
        )
        distance = self._radius() * 1.9
        camera.look_at = (x, y, z * 0.6)
        camera.position = (x - distance * 0.62, y - distance * 0.62, z * 0.6 + distance * 0.62)

    def _center(self) -> Triple:
        """Return the center of the bodies on joints, else of all bodies."""
        names = list(self._paths)
        moving = {body.name for body in self._description.bodies if body.joints}
        positions = world_positions(self._description, {})
        chosen = [place for name, place in zip(names, positions, strict=True) if name in moving] or positions
        if not chosen:
            return (0.0, 0.0, 0.0)
        mean = np.mean(np.array(chosen), axis=0)
        return (float(mean[0]), float(mean[1]), float(mean[2]))

    def _radius(self) -> float:
        positions = world_positions(self._description, {})
        if not positions:
            return USUAL_VIEW
        reach = float(np.max(np.linalg.norm(np.array(positions) - np.array(self._center()), axis=1)))
        return min(max(reach, MIN_VIEW), MAX_VIEW) if reach else USUAL_VIEW

    def _place_fixed_bodies(self) -> None:
        for body in self._description.bodies:
            if body.name in self.frames and not body.joints:
                self.frames[body.name].position = body.position
                self.frames[body.name].wxyz = body.orientation

    def _add_label(self) -> viser.LabelHandle:
        """Add the event reference above the first moving body; it moves with the body."""
        poses = world_poses(self._description, {})
        top = max((pose.position[2] for pose in poses.values()), default=0.0) + LABEL_LIFT
        name = next((body.name for body in self._moving), None)
        root, place = "/robot", (0.0, 0.0, top)
        if name is not None:  # its frame may be turned: up is up in the world's
            x, y, _ = poses[name].position
            root = self._paths[name]
            place = joined(inverse(poses[name]), Pose((x, y, top), UPRIGHT)).position
        return self._server.scene.add_label(
            f"{root}/event", "", position=place, anchor="bottom-center", font_screen_scale=1.4
        )

    def _add_arrow(self) -> viser.ArrowsHandle | None:
        sensor = self._description.wrench
        if sensor is None or sensor.body not in self._paths:
            return None
        body = next(each for each in self._description.bodies if each.name == sensor.body)
        self._skin = _skin(body)
        points = np.zeros((1, 2, 3), dtype=np.float32)
        return self._server.scene.add_arrows(f"{self._paths[sensor.body]}/wrench", points, ARROW, visible=False)

    def _pose_arrow(self, wrench: list[float]) -> None:
        sensor = self._description.wrench
        if self.arrow is None or sensor is None:
            return
        force = np.array(wrench[:3], dtype=np.float32)
        felt = force.shape == (3,) and float(np.linalg.norm(force)) >= max(sensor.threshold_force, 1e-12)
        if felt:
            size = float(np.linalg.norm(force))
            way = force / size
            length = max(ARROW_LEAST, min(1.0, size / max(sensor.full_scale_force, 1e-12)) * ARROW_LENGTH)
            tail = np.array((0.0, 0.0, self._skin[1]), dtype=np.float32) + way * self._skin[0]
            self.arrow.points = np.array([[tail, tail + way * length]], dtype=np.float32)
        if self.arrow.visible != felt:
            self.arrow.visible = felt

    def _add_points(self) -> viser.PointCloudHandle | None:
        ring = self._description.ranges
        if ring is None or ring.body not in self._paths:
            return None
        return self._server.scene.add_point_cloud(
            f"{self._paths[ring.body]}/ranges",
            np.zeros((1, 3), dtype=np.float32),
            RANGES,
            point_size=0.04,
            point_shape="circle",
            visible=False,
        )

    def _pose_points(self, ranges: list[float]) -> None:
        ring = self._description.ranges
        if self.points is None or self.rays is None or ring is None:
            return
        seen = [
            (distance * math.cos(angle), distance * math.sin(angle), 0.0)
            for number, distance in enumerate(ranges)
            if ring.range_min <= distance < ring.range_max
            for angle in (ring.angle_min + number * ring.angle_increment,)
        ]
        ends = np.array(seen, dtype=np.float32)
        if seen:
            self.points.points = ends
            self.rays.points = np.stack((np.zeros_like(ends), ends), axis=1)
        for handle in (self.points, self.rays):
            if handle.visible != bool(seen):
                handle.visible = bool(seen)

    def _add_rays(self) -> viser.LineSegmentsHandle | None:
        """Add a ray from the ring to the point that each of its sensors sees."""
        ring = self._description.ranges
        if ring is None or ring.body not in self._paths:
            return None
        return self._server.scene.add_line_segments(
            f"{self._paths[ring.body]}/rays",
            np.zeros((1, 2, 3), dtype=np.float32),
            RAY,
            thickness=1.0,
            thickness_units="screen",
            visible=False,
        )


def _skin(body: Body) -> tuple[float, float]:
    """Return the body's extent from its origin, and the height of its middle: an arrow inside it would be hidden."""
    around = [
        (max(geom.size) if geom.shape == "box" else geom.size[0], geom.position[2])
        for geom in body.geoms
        if math.hypot(*geom.position) <= math.hypot(*geom.size)
    ]
    return max(around, default=(0.0, 0.0))


def length_words(metres: float) -> str:
    """Return a length as people write it: "500 nm"."""
    for unit, size in (("m", 1.0), ("mm", 1e-3), ("µm", 1e-6)):
        if metres >= 0.1 * size:
            return f"{metres / size:.3g} {unit}"
    return f"{metres / 1e-9:.3g} nm"
