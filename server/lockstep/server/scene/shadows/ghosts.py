"""Draws in the 3D scene what policies want that do not drive. Runs in the scene's own thread."""

from collections.abc import Mapping, Sequence
from typing import Final

import viser

from lockstep.protocol.description import RobotDescription
from lockstep.server.scene.commanded_pose import SceneGhost
from lockstep.server.scene.kinematics import Pose
from lockstep.server.scene.tool_frames import tool_place

__all__ = ["MOST_SHADOWS", "SceneShadows"]

MOST_SHADOWS: Final = 3  # more would hide the robot, and each is a copy of its shapes
VIOLET: Final = (0.66, 0.55, 0.98, 0.2)  # as the page's bar of a policy; paler than what is commanded
ORIGIN: Final = (168, 140, 250)
AXIS: Final = 0.1  # of the robot's radius
THICK: Final = 0.02  # of an axis' length
LIFT: Final = 0.03  # of the radius, of a name above its frame


class _Shadow:
    """A pale arm where the joints are wanted elsewhere, and the frame of each tool, with the policy's name."""

    def __init__(
        self, server: viser.ViserServer, description: RobotDescription, number: int, radius: float, least: float
    ) -> None:
        self._root = f"/shadows/{number}"
        self.root = server.scene.add_frame(self._root, show_axes=False, visible=False)
        self.arm = SceneGhost(server, description, least, label="", root=f"{self._root}/arm", color=VIOLET)
        self.arm.label.visible = bool(not description.poses)
        length = AXIS * radius
        self.tools = [
            (
                pose,
                server.scene.add_frame(
                    f"{self._root}/tool{index}",
                    visible=False,
                    axes_length=length,
                    axes_radius=THICK * length,
                    origin_radius=4 * THICK * length,
                    origin_color=ORIGIN,
                ),
                server.scene.add_label(
                    f"{self._root}/tool{index}/name", "", position=(0.0, 0.0, LIFT * radius), font_screen_scale=0.8
                ),
            )
            for index, pose in enumerate(description.poses)
        ]

    def show(self, name: str, wanted: Mapping[str, Pose], measured: Mapping[str, Pose]) -> None:
        self.root.visible = True
        self.arm.show(wanted, measured)
        text = f"{name} (shadow)"
        for label in (self.arm.label, *(label for _, _, label in self.tools)):
            if label.text != text:
                label.text = text
        for pose, frame, _ in self.tools:
            place = tool_place(pose, wanted)
            if place is not None:
                frame.position, frame.wxyz = place.position, place.orientation
            if frame.visible != (place is not None):
                frame.visible = place is not None

    def hide(self) -> None:
        if self.root.visible:
            self.root.visible = False


class SceneShadows:
    """Makes the shapes of a shadow when there is one for the first time."""

    def __init__(self, server: viser.ViserServer, description: RobotDescription, radius: float, least: float) -> None:
        """`radius`: m, of the robot. `least`: m, by which a part is elsewhere at least to be drawn."""
        self._server = server
        self._description = description
        self._radius = radius
        self._least = least
        self.drawn: list[_Shadow] = []

    def show(self, shadows: Sequence[tuple[str, Mapping[str, Pose]]], measured: Mapping[str, Pose]) -> None:
        """Show the first of these; see `SceneModel.pose`."""
        shown = shadows[:MOST_SHADOWS]
        while len(self.drawn) < len(shown):
            made = _Shadow(self._server, self._description, len(self.drawn), self._radius, self._least)
            self.drawn.append(made)
        for shadow, (name, wanted) in zip(self.drawn, shown, strict=False):
            shadow.show(name, wanted, measured)
        for shadow in self.drawn[len(shown) :]:
            shadow.hide()
