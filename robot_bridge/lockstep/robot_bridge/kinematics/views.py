"""An arm as it is seen from a place that stands still beside it, such as a camera's."""

from collections.abc import Sequence
from typing import NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt

from lockstep.protocol.description import Body
from lockstep.robot_bridge.kinematics.chain import NoChain
from lockstep.robot_bridge.kinematics.obstacles import Obstacle
from lockstep.robot_bridge.kinematics.rotations import from_quaternion, quaternion

__all__ = ["View", "view_from"]

Array = npt.NDArray[np.float64]


class View(NamedTuple):
    """A place from which an arm is seen."""

    base: str  # the body on which the arm stands; "": the world
    position: Array  # m, of the place, in the frame of the base
    rotation: Array  # 3 x 3, of the place against that frame

    def bodies(self, bodies: Sequence[Body]) -> list[Body]:
        """Return the bodies with this place as their world: a `Chain` of them has its poses in this frame."""
        return [self._seen(body) if self._is_root(body) else body for body in bodies]

    def obstacle(self, obstacle: Obstacle) -> Obstacle:
        """Return an obstacle of the base's frame in this one."""
        return obstacle._replace(
            position=self.rotation.T @ (obstacle.position - self.position),
            rotation=self.rotation.T @ obstacle.rotation,
        )

    def _is_root(self, body: Body) -> bool:
        return body.name == self.base if self.base else not body.parent

    def _seen(self, body: Body) -> Body:
        if self.base:  # which stands still here
            body = msgspec.structs.replace(
                body, parent="", joints=(), position=(0.0, 0.0, 0.0), orientation=(1.0, 0.0, 0.0, 0.0)
            )
        x, y, z = (self.rotation.T @ (np.array(body.position) - self.position)).tolist()
        turn = self.rotation.T @ from_quaternion(body.orientation)
        return msgspec.structs.replace(body, position=(x, y, z), orientation=quaternion(turn))


def view_from(
    bodies: Sequence[Body], base: str, body: str, position: Sequence[float], orientation: Sequence[float]
) -> View:
    """Return the view from a place on a body that stands still beside the arm.

    Args:
        base: the body on which the arm stands; "": the world
        body: that carries the place; "": the world
        position: m, in the body's frame
        orientation: w, x, y, z, in the body's frame

    Raises:
        NoChain: a joint is between the base and the body, or the body does not hang on the base.
    """
    known = {each.name: each for each in bodies}
    place, turn = np.array(position, dtype=np.float64), from_quaternion(orientation)
    name, seen = body, 0
    while name != base:
        carrier = known.get(name)
        if carrier is None or seen > len(known):
            raise NoChain(f"{body or 'the world'} does not stand on {base or 'the world'}, as the arm does")
        if carrier.joints:
            raise NoChain(f"a joint moves {body} against {base or 'the world'}, on which the arm stands")
        step = from_quaternion(carrier.orientation)
        place, turn = np.array(carrier.position) + step @ place, step @ turn
        name, seen = carrier.parent, seen + 1
    return View(base, place, turn)
