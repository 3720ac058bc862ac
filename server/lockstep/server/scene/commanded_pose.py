"""Draws the commanded robot over the measured one in the 3D scene. Runs in the scene's own thread."""

import math
from collections.abc import Mapping

import viser

from lockstep.protocol.description import Geom, RobotDescription
from lockstep.server.scene.kinematics import Pose, scene_paths
from lockstep.server.scene.shapes import add_geom

__all__ = ["SceneGhost"]

Color = tuple[float, float, float, float]
COLOR: Color = (1.0, 0.76, 0.30, 0.32)
LARGER = 1.02  # so that it covers the parts that it agrees with
SOLID = 0.5  # geoms more transparent than this have no ghost
SAME_WAY = math.cos(math.radians(3) / 2)
LIFT = 0.2  # m, of the label above the lowest moving body


class SceneGhost:
    """A translucent robot, shown only while the commands alone would have led elsewhere."""

    def __init__(
        self,
        server: viser.ViserServer,
        description: RobotDescription,
        least: float,
        *,
        label: str,
        root: str = "/ghost",
        color: Color = COLOR,
    ) -> None:
        """`least`: m, by which a part is elsewhere at least. `root`: of its names in the scene."""
        self._least = least
        paths = scene_paths(description)
        moving = {path for body in description.bodies if body.joints and (path := paths.get(body.name))}
        chosen = [
            body
            for body in description.bodies
            if body.name in paths and any(f"{paths[body.name]}/".startswith(f"{path}/") for path in moving)
        ]
        self._root = server.scene.add_frame(root, show_axes=False, visible=False)
        self._frames = {}
        for number, body in enumerate(chosen):
            self._frames[body.name] = server.scene.add_frame(f"{root}/{number}", show_axes=False)
            for index, geom in enumerate(body.geoms):
                if geom.rgba[3] >= SOLID:
                    add_geom(server, f"{root}/{number}/geom{index}", _ghostly(geom, color))
        self.label = server.scene.add_label(
            f"{root}/0/label" if chosen else f"{root}/label",
            label,
            position=(0.0, 0.0, -LIFT),
            anchor="top-center",
            font_screen_scale=0.9,
        )

    @property
    def visible(self) -> bool:
        return bool(self._root.visible)

    def show(self, poses: Mapping[str, Pose] | None, measured: Mapping[str, Pose]) -> None:
        """Show the commanded poses; None: nothing is commanded, or its effect is unknown."""
        shown = poses is not None and any(self._differs(poses[name], measured[name]) for name in self._frames)
        if shown and poses is not None:
            for name, frame in self._frames.items():
                frame.position, frame.wxyz = poses[name].position, poses[name].orientation
        if self._root.visible != shown:
            self._root.visible = shown

    def _differs(self, pose: Pose, measured: Pose) -> bool:
        """Return whether the poses differ visibly: a ghost that covers its robot says nothing and flickers."""
        agreement = abs(sum(a * b for a, b in zip(pose.orientation, measured.orientation, strict=True)))
        return agreement < SAME_WAY or math.dist(pose.position, measured.position) > self._least


def _ghostly(geom: Geom, color: Color) -> Geom:
    x, y, z = geom.size
    return Geom(
        shape=geom.shape,
        size=(x * LARGER, y * LARGER, z * LARGER),
        position=geom.position,
        orientation=geom.orientation,
        rgba=color,
        vertices=tuple(value * LARGER for value in geom.vertices),
        triangles=geom.triangles,
    )
