"""What a model's arm keeps off besides itself: `<text name="lockstep_obstacles" data="floor table"/>`."""

from collections.abc import Iterator, Sequence
from typing import Any, Final

import mujoco
import numpy as np
import numpy.typing as npt

from lockstep.robot_bridge.errors import ModelError
from lockstep.robot_bridge.kinematics.obstacles import Obstacle, Surface, plane
from lockstep.robot_bridge.kinematics.surfaces import joined
from lockstep.robot_bridge.robots.mjcf.names import name_of
from lockstep.robot_bridge.robots.mjcf.texts import words_of
from lockstep.robot_bridge.robots.mjcf.tools.capsules import surface_points

__all__ = ["OBSTACLES", "obstacles_of", "surfaces_of"]

Array = npt.NDArray[np.float64]
OBSTACLES: Final = "lockstep_obstacles"
MOST: Final = 16  # each costs time in every tick in which the arm is near it
PLANE: Final = int(mujoco.mjtGeom.mjGEOM_PLANE)


def obstacles_of(model: Any, data: Any) -> tuple[Obstacle, ...]:
    """Return the geoms, and those of the bodies, that the model names. Planes are endless, other shapes are boxes.

    Raises:
        ModelError: one does not exist, has no shape, or is moved by a joint; or there are too many.
    """
    found = [_obstacle(model, data, word, geom) for word in words_of(model, OBSTACLES) for geom in _geoms(model, word)]
    if len(found) > MOST:
        raise ModelError(f"{OBSTACLES} names {len(found)} shapes; at most {MOST} are kept off")
    return tuple(found)


def surfaces_of(model: Any, data: Any, path: Sequence[int]) -> dict[str, Surface]:
    """Return points on the shapes of the arm's bodies that can collide, by body.

    What hangs on them by other joints, such as a finger, counts as fixed where `data` has it.
    """
    found: dict[int, list[Surface]] = {}
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom])
        while body and body not in path:
            body = int(model.body_parentid[body])
        if not body or not (model.geom_contype[geom] or model.geom_conaffinity[geom]):
            continue
        points, radius = surface_points(model, geom)
        world = points @ _turn(data.geom_xmat[geom]).T + data.geom_xpos[geom]
        own = (world - data.xpos[body]) @ _turn(data.xmat[body])
        found.setdefault(body, []).append(Surface(own, np.full(len(own), radius)))
    return {name_of(model, "body", body): joined(surfaces) for body, surfaces in found.items()}


def _geoms(model: Any, word: str) -> Iterator[int]:
    geom = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, word)
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, word)
    first, count = (geom, 1) if geom >= 0 else (int(model.body_geomadr[body]), int(model.body_geomnum[body]))
    if geom < 0 and (body < 0 or not count):
        raise ModelError(f"{OBSTACLES} names {word!r}, which is neither a geom nor a body with geoms")
    if int(model.body_weldid[model.geom_bodyid[first]]):
        raise ModelError(f"{OBSTACLES} names {word!r}, which a joint moves")
    yield from range(first, first + count)


def _obstacle(model: Any, data: Any, word: str, geom: int) -> Obstacle:
    name, place, turn = f"the {word}", np.array(data.geom_xpos[geom]), _turn(data.geom_xmat[geom])
    if int(model.geom_type[geom]) == PLANE:
        return plane(name, place.tolist(), turn[:, 2].tolist())
    box = model.geom_aabb[geom]
    return Obstacle(name, place + turn @ box[:3], turn, np.array(box[3:]))


def _turn(matrix: Any) -> Array:
    return np.array(matrix, dtype=np.float64).reshape(3, 3)
