"""Builds a robot in viser from its description, and poses it from feedback. Runs in the scene's own thread."""

import math

import numpy as np
import trimesh
import viser

from robot_bridge.protocol.description import Geom, RobotDescription
from robot_bridge.protocol.messages import Feedback
from server.kinematics import body_pose, scene_paths, world_positions
from server.scene_fences import SceneFences

__all__ = ["SceneModel"]

BACKGROUND = (16, 20, 26)
GRID = (44, 52, 64)
GRID_SECTION = (66, 78, 94)
ARROW = (255, 176, 32)
RANGES = (64, 200, 255)
LABEL_LIFT = 0.4  # m above the highest joint
FLOOR_LIFT = 0.004  # m, so that the grid shows on a floor of the robot's own
STOPPED = " · STOPPED"
ARROW_LENGTH = 0.6  # m at full scale
MIN_VIEW, MAX_VIEW = 1.6, 6.0  # m, how far the first look stands off

Triple = tuple[float, float, float]


class SceneModel:
    """One robot in one viser server. `pose` sets only what changed."""

    def __init__(self, server: viser.ViserServer, description: RobotDescription) -> None:
        self._server = server
        self._description = description
        self._paths = scene_paths(description)
        self._joint_names = [joint.name for joint in description.joints]
        self._build_surroundings()
        self.frames = {
            body.name: server.scene.add_frame(self._paths[body.name], show_axes=False)
            for body in sorted(description.bodies, key=lambda body: self._paths.get(body.name, "").count("/"))
            if body.name in self._paths
        }
        for body in description.bodies:
            for number, geom in enumerate(body.geoms if body.name in self._paths else ()):
                _add_geom(server, f"{self._paths[body.name]}/geom{number}", geom)
        self._moving = [body for body in description.bodies if body.joints and body.name in self._paths]
        self._place_fixed_bodies()
        self.label = self._add_label()
        self.arrow = self._add_arrow()
        self.points = self._add_points()
        self.fences = SceneFences(server, description)

    def pose(self, feedback: Feedback) -> None:
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

    def _build_surroundings(self) -> None:
        scene, camera = self._server.scene, self._server.initial_camera
        scene.set_background_image(np.full((2, 2, 3), BACKGROUND, dtype=np.uint8), format="png")
        scene.add_grid(
            "/floor",
            width=20.0,
            height=20.0,
            cell_size=0.5,
            section_size=1.0,
            cell_color=GRID,
            section_color=GRID_SECTION,
            fade_distance=14.0,
            position=(0.0, 0.0, FLOOR_LIFT),
        )
        x, y, z = self._center()
        distance = self._radius() * 1.9
        camera.look_at = (x, y, z * 0.6)
        camera.position = (x - distance * 0.62, y - distance * 0.62, z * 0.6 + distance * 0.62)

    def _center(self) -> Triple:
        """Of the bodies that hang on joints, else of all."""
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
            return MIN_VIEW
        reach = float(np.max(np.linalg.norm(np.array(positions) - np.array(self._center()), axis=1)))
        return min(max(reach, MIN_VIEW), MAX_VIEW)

    def _place_fixed_bodies(self) -> None:
        for body in self._description.bodies:
            if body.name in self.frames and not body.joints:
                self.frames[body.name].position = body.position
                self.frames[body.name].wxyz = body.orientation

    def _add_label(self) -> viser.LabelHandle:
        """The event reference, above what moves first, and moving with it."""
        positions = world_positions(self._description, {})
        top = max((z for _, _, z in positions), default=0.0) + LABEL_LIFT
        root = next((self._paths[body.name] for body in self._moving), "/robot")
        return self._server.scene.add_label(
            f"{root}/event", "", position=(0.0, 0.0, top), anchor="bottom-center", font_screen_scale=1.4
        )

    def _add_arrow(self) -> viser.ArrowsHandle | None:
        sensor = self._description.wrench
        if sensor is None or sensor.body not in self._paths:
            return None
        points = np.zeros((1, 2, 3), dtype=np.float32)
        return self._server.scene.add_arrows(f"{self._paths[sensor.body]}/wrench", points, ARROW, visible=False)

    def _pose_arrow(self, wrench: list[float]) -> None:
        sensor = self._description.wrench
        if self.arrow is None or sensor is None:
            return
        force = np.array(wrench[:3], dtype=np.float32)
        felt = force.shape == (3,) and float(np.linalg.norm(force)) >= sensor.threshold_force
        if felt:
            tip = force / max(sensor.full_scale_force, 1e-6) * ARROW_LENGTH
            self.arrow.points = np.array([[np.zeros(3), tip]], dtype=np.float32)
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
        if self.points is None or ring is None:
            return
        seen = [
            (distance * math.cos(angle), distance * math.sin(angle), 0.0)
            for number, distance in enumerate(ranges)
            if ring.range_min <= distance < ring.range_max
            for angle in (ring.angle_min + number * ring.angle_increment,)
        ]
        if seen:
            self.points.points = np.array(seen, dtype=np.float32)
        if self.points.visible != bool(seen):
            self.points.visible = bool(seen)


def _add_geom(server: viser.ViserServer, path: str, geom: Geom) -> None:
    scene, (first, second, _) = server.scene, geom.size
    red, green, blue, alpha = geom.rgba
    color = (round(red * 255), round(green * 255), round(blue * 255))
    opacity = None if alpha >= 1 else alpha
    at, wxyz = geom.position, geom.orientation
    if geom.shape == "box":
        dimensions = (2 * geom.size[0], 2 * geom.size[1], 2 * geom.size[2])
        scene.add_box(path, color=color, dimensions=dimensions, opacity=opacity, position=at, wxyz=wxyz)
    elif geom.shape == "sphere":
        scene.add_icosphere(path, radius=first, color=color, opacity=opacity, position=at, wxyz=wxyz)
    else:
        make = trimesh.creation.cylinder if geom.shape == "cylinder" else trimesh.creation.capsule
        mesh = make(radius=first, height=2 * second)
        # viser's cylinder stands on another axis than ours (z), and it has no capsule: both go as meshes, centred.
        vertices = np.asarray(mesh.vertices - mesh.bounds.mean(axis=0), dtype=np.float32)
        scene.add_mesh_simple(
            path, vertices, np.asarray(mesh.faces), color=color, opacity=opacity, position=at, wxyz=wxyz
        )
