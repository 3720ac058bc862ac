"""Describes bodies of a compiled MuJoCo model for the 3D view, for robots whose models are simple.

Each joint acts at its body's origin and begins at zero; shapes that are no box, sphere, cylinder or capsule are left
out. `mjcf/bodies.py` describes any model.
"""

from collections.abc import Callable, Collection, Iterator
from typing import Any, Final

import mujoco

from lockstep.protocol.description import Body, BodyJoint, Geom

__all__ = ["SLIDE", "Colour", "describe_body", "rounded"]

SHAPES: Final = {
    int(mujoco.mjtGeom.mjGEOM_BOX): "box",
    int(mujoco.mjtGeom.mjGEOM_SPHERE): "sphere",
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): "cylinder",
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): "capsule",
}
SLIDE: Final = int(mujoco.mjtJoint.mjJNT_SLIDE)

Colour = Callable[[Any, int], Any]  # model, number of a geom -> RGBA, each from 0 to 1


def describe_body(
    model: Any, number: int, groups: Collection[int], digits: int, *, prefix: str = "", colour: Colour | None = None
) -> Body:
    """Return the body with this number.

    Args:
        groups: of the geoms that are drawn
        digits: of every number, behind the point
        prefix: of the joints' names in the model, which the description lacks
        colour: of a geom without a material; None: its own
    """
    parent = model.body_parentid[number]
    first, count = model.body_jntadr[number], model.body_jntnum[number]
    return Body(
        name=model.body(number).name,
        parent=model.body(parent).name if parent else "",
        position=rounded(model.body_pos[number], digits),
        orientation=rounded(model.body_quat[number], digits),
        joints=tuple(
            BodyJoint(
                joint=model.joint(joint).name.removeprefix(prefix),
                kind="prismatic" if model.jnt_type[joint] == SLIDE else "revolute",
                axis=rounded(model.jnt_axis[joint], digits),
            )
            for joint in range(first, first + count)
        ),
        geoms=tuple(_geoms(model, number, groups, digits, colour or _own_colour)),
    )


def _geoms(model: Any, body: int, groups: Collection[int], digits: int, colour: Colour) -> Iterator[Geom]:
    first = model.body_geomadr[body]
    for number in range(first, first + model.body_geomnum[body]):
        shape = SHAPES.get(int(model.geom_type[number]))
        if shape is None or model.geom_group[number] not in groups:
            continue
        material = model.geom_matid[number]
        yield Geom(
            shape=shape,  # type: ignore[arg-type]
            size=rounded(model.geom_size[number], digits),
            position=rounded(model.geom_pos[number], digits),
            orientation=rounded(model.geom_quat[number], digits),
            rgba=rounded(model.mat_rgba[material] if material >= 0 else colour(model, number), digits),
        )


def _own_colour(model: Any, geom: int) -> Any:
    return model.geom_rgba[geom]


def rounded(values: Any, digits: int) -> Any:
    """Return the values as a tuple of floats, short on the wire; never -0."""
    return tuple(round(float(value), digits) + 0.0 for value in values)
