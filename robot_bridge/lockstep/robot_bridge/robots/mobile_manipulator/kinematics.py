"""Reads the description's bodies and joints from the compiled model, so that both agree."""

from collections.abc import Iterator
from typing import Any, Final

import mujoco

from lockstep.protocol.description import Body, BodyJoint, Geom, Joint
from lockstep.robot_bridge.robots.mobile_manipulator.simulation import JOINTS

__all__ = ["describe_bodies", "describe_joints"]

SHAPES: Final = {
    int(mujoco.mjtGeom.mjGEOM_BOX): "box",
    int(mujoco.mjtGeom.mjGEOM_SPHERE): "sphere",
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): "cylinder",
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): "capsule",
}
DRAWN_GROUPS: Final = (1, 4)
STATIC_BODIES: Final = ("room", "table")
SLIDE: Final = int(mujoco.mjtJoint.mjJNT_SLIDE)
DIGITS: Final = 5


def describe_joints(model: Any) -> tuple[Joint, ...]:
    """Return the robot's joints in the order of the measurement."""
    return tuple(describe_joint(model, index) for index in range(JOINTS))


def describe_bodies(model: Any) -> tuple[Body, ...]:
    """Return the room's fixed bodies, then the robot's from the base to the tool, parents first.

    Movable objects are left out: feedback does not say where they are.
    """
    robot = model.body("base").id
    static = [model.body(name).id for name in STATIC_BODIES]
    moving = [index for index in range(model.nbody) if model.body_rootid[index] == robot]
    return tuple(describe_body(model, index) for index in (*static, *moving))


def describe_joint(model: Any, index: int) -> Joint:
    lower, upper = rounded(model.jnt_range[index]) if model.jnt_limited[index] else (None, None)
    unit = "m" if model.jnt_type[index] == SLIDE else "rad"
    return Joint(name=model.joint(index).name, unit=unit, minimum=lower, maximum=upper)  # type: ignore[arg-type]


def describe_body(model: Any, index: int) -> Body:
    parent = model.body_parentid[index]
    first, count = model.body_jntadr[index], model.body_jntnum[index]
    return Body(
        name=model.body(index).name,
        parent=model.body(parent).name if parent else "",
        position=rounded(model.body_pos[index]),
        orientation=rounded(model.body_quat[index]),
        joints=tuple(
            BodyJoint(
                joint=model.joint(joint).name,
                kind="prismatic" if model.jnt_type[joint] == SLIDE else "revolute",
                axis=rounded(model.jnt_axis[joint]),
            )
            for joint in range(first, first + count)
        ),
        geoms=tuple(describe_geoms(model, index)),
    )


def describe_geoms(model: Any, body: int) -> Iterator[Geom]:
    first = model.body_geomadr[body]
    for index in range(first, first + model.body_geomnum[body]):
        shape = SHAPES.get(int(model.geom_type[index]))
        if shape is None or model.geom_group[index] not in DRAWN_GROUPS:
            continue
        material = model.geom_matid[index]
        yield Geom(
            shape=shape,  # type: ignore[arg-type]
            size=rounded(model.geom_size[index]),
            position=rounded(model.geom_pos[index]),
            orientation=rounded(model.geom_quat[index]),
            rgba=rounded(model.mat_rgba[material] if material >= 0 else model.geom_rgba[index]),
        )


def rounded(values: Any) -> Any:
    """Return the values as a tuple of floats, short on the wire; never -0."""
    return tuple(round(float(value), DIGITS) + 0.0 for value in values)
