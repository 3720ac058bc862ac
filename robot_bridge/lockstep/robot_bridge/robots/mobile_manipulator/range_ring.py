"""The ring of range sensors around the base: rays against the room and the movable objects."""

from typing import Any, Final

import mujoco
import numpy as np
import numpy.typing as npt

from lockstep.protocol.description import RangeRing

__all__ = ["RING", "RangeSensors"]

RING: Final = RangeRing(
    name="ranges",
    body="range_ring",
    count=24,
    angle_min=0.0,
    angle_increment=round(2.0 * np.pi / 24, 6),
    range_min=0.31,
    range_max=6.0,
)


class RangeSensors:
    """Measures distances from the ring's centre."""

    def __init__(self, model: Any) -> None:
        self._model = model
        self._body = model.body(RING.body).id
        angles = RING.angle_min + RING.angle_increment * np.arange(RING.count)
        self._rays = np.stack((np.cos(angles), np.sin(angles), np.zeros(RING.count)))
        self._seen = np.array((0, 0, 0, 0, 1, 0), dtype=np.uint8)  # the geom group of the room and the objects
        self._geoms = np.zeros(RING.count, dtype=np.int32)
        self._distances = np.zeros(RING.count)

    def read(self, data: Any) -> npt.NDArray[np.float64]:
        """Return one distance per sensor; range_max if nothing is seen."""
        directions = (data.xmat[self._body].reshape(3, 3) @ self._rays).T.ravel()
        mujoco.mj_multiRay(
            self._model,
            data,
            data.xpos[self._body],
            directions,
            self._seen,
            True,
            -1,
            self._geoms,
            self._distances,
            None,
            RING.count,
            RING.range_max,
        )
        return np.where(self._geoms < 0, RING.range_max, self._distances.clip(RING.range_min, RING.range_max))
