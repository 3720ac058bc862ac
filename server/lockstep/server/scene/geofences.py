"""The zones of a robot's description, drawn on the floor of the 3D scene. Runs in the scene's own thread."""

from collections.abc import Collection

import numpy as np
import viser

from lockstep.protocol.description import Geofence, RobotDescription

__all__ = ["SceneFences"]

KEEP_IN = (64, 200, 140)
KEEP_OUT = (255, 96, 80)
LIFT = 0.012  # m above the floor
CALM, ACTING = 2.0, 6.0  # pixels


class SceneFences:
    """Lines around the zones; they get thick while a zone slows the robot."""

    def __init__(self, server: viser.ViserServer, description: RobotDescription) -> None:
        self.lines = {
            fence.name: server.scene.add_line_segments(
                f"/geofences/{number}",
                points=_edges(fence),
                colors=KEEP_OUT if fence.kind == "keep_out" else KEEP_IN,
                thickness=CALM,
                thickness_units="screen",
            )
            for number, fence in enumerate(description.geofences)
            if len(fence.polygon) > 1  # the bridge checks it; one by another author may not
        }
        self._acting: frozenset[str] = frozenset()

    def show(self, acting: Collection[str]) -> None:
        """Set the thickness of the lines that changed."""
        now = frozenset(acting) & self.lines.keys()
        for name in now ^ self._acting:
            self.lines[name].thickness = ACTING if name in now else CALM
        self._acting = now


def _edges(fence: Geofence) -> np.typing.NDArray[np.float32]:
    """Return the edges as an array (edges, 2 ends, xyz)."""
    corners = np.array([(x, y, LIFT) for x, y in fence.polygon], np.float32)
    return np.stack((corners, np.roll(corners, -1, axis=0)), axis=1)
