"""Describes the model's bodies and their shapes for the 3D view: the same tree, posed by the same joints."""

import math
from collections.abc import Iterator, Sequence
from typing import Any, Final

import mujoco

from lockstep.protocol.description import Body, Geom
from lockstep.robot_bridge.robots.mjcf.joints import ModelJoint
from lockstep.robot_bridge.robots.mjcf.names import name_of

__all__ = ["DRAWN_GROUPS", "bodies_of"]

DRAWN_GROUPS: Final = (0, 1, 2)  # MuJoCo shows these; others are collision hulls by custom
MOST_GEOMS: Final = 300
BOX, SPHERE, CYLINDER, CAPSULE, ELLIPSOID, PLANE = (
    int(getattr(mujoco.mjtGeom, f"mjGEOM_{shape}"))
    for shape in ("BOX", "SPHERE", "CYLINDER", "CAPSULE", "ELLIPSOID", "PLANE")
)
SIMPLE: Final = {BOX: "box", SPHERE: "sphere", CYLINDER: "cylinder", CAPSULE: "capsule"}
THICKNESS: Final = 0.002  # of a plane, as a share of the model's size

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


def bodies_of(model: Any, joints: Sequence[ModelJoint]) -> tuple[Body, ...]:
    """Return the bodies, parents first.

    Bodies that hang on a joint which is not described are left out, with all that hang on them.
    """
    described = {joint.number: joint for joint in joints}
    left, found, lost = MOST_GEOMS, list[Body](), set[int]()
    for number in range(model.nbody):
        own = range(model.body_jntadr[number], model.body_jntadr[number] + model.body_jntnum[number])
        if (number and int(model.body_parentid[number]) in lost) or any(joint not in described for joint in own):
            lost.add(number)
            continue
        geoms = tuple(_geoms(model, number))[:left]
        left -= len(geoms)
        if number or geoms:
            found += _chain(model, number, [described[joint] for joint in own], geoms)
    return tuple(found)


def _chain(model: Any, number: int, joints: Sequence[ModelJoint], geoms: tuple[Geom, ...]) -> Iterator[Body]:
    """Yield the body, after a pivot for each joint that does not act at the body's origin or does not begin at zero."""
    name = name_of(model, "body", number)
    parent = int(model.body_parentid[number])
    above = name_of(model, "body", parent) if number and (parent or _has_geoms(model, 0)) else ""
    position, orientation = _triple(model.body_pos[number]), _quaternion(model.body_quat[number])
    if joints and joints[0].is_free:
        yield Body(name=name, parent="", joints=joints[0].moves, geoms=geoms)
        return
    if all(_is_simple(model, joint) for joint in joints):
        moves = tuple(move for joint in joints for move in joint.moves)
        yield Body(name=name, parent=above, position=position, orientation=orientation, joints=moves, geoms=geoms)
        return
    frame = f"{name}.frame"
    yield Body(name=frame, parent=above, position=position, orientation=orientation)
    reached: Vector = (0.0, 0.0, 0.0)  # the last pivot, in the body's own frame
    for joint in joints:
        place, turn = _pivot(model, joint)
        step = (place[0] - reached[0], place[1] - reached[1], place[2] - reached[2])
        pivot = f"{name}.{joint.parts[0].name}"
        zero = _zero(model, joint)
        yield Body(
            name=pivot,
            parent=frame,
            position=(step[0] + zero[0], step[1] + zero[1], step[2] + zero[2]),
            orientation=turn,
            joints=joint.moves,
        )
        frame, reached = pivot, place
    yield Body(name=name, parent=frame, position=(-reached[0], -reached[1], -reached[2]), geoms=geoms)


def _is_simple(model: Any, joint: ModelJoint) -> bool:
    return joint.is_ball or (not any(model.jnt_pos[joint.number]) and not model.qpos0[joint.qpos])


def _pivot(model: Any, joint: ModelJoint) -> tuple[Vector, Quaternion]:
    """Return the place where the joint acts, and the turn that takes away the angle at which the model begins."""
    place = _triple(model.jnt_pos[joint.number])
    if joint.is_ball or joint.moves[0].kind == "prismatic":
        return place, (1.0, 0.0, 0.0, 0.0)
    half = -float(model.qpos0[joint.qpos]) / 2
    x, y, z = joint.moves[0].axis
    return place, (math.cos(half), math.sin(half) * x, math.sin(half) * y, math.sin(half) * z)


def _zero(model: Any, joint: ModelJoint) -> Vector:
    """Return a slide's place at zero, relative to where the model begins."""
    if joint.is_ball or joint.moves[0].kind != "prismatic":
        return (0.0, 0.0, 0.0)
    x, y, z = joint.moves[0].axis
    back = -float(model.qpos0[joint.qpos])
    return (x * back, y * back, z * back)


def _has_geoms(model: Any, body: int) -> bool:
    return next(_geoms(model, body), None) is not None


def _geoms(model: Any, body: int) -> Iterator[Geom]:
    first = model.body_geomadr[body]
    for number in range(first, first + model.body_geomnum[body]):
        material = model.geom_matid[number]
        red, green, blue, alpha = (
            float(part) for part in (model.mat_rgba[material] if material >= 0 else model.geom_rgba[number])
        )
        if model.geom_group[number] in DRAWN_GROUPS and alpha > 0:
            yield _geom(model, number, (red, green, blue, alpha))


def _geom(model: Any, number: int, rgba: tuple[float, float, float, float]) -> Geom:
    kind, size = int(model.geom_type[number]), _triple(model.geom_size[number])
    position, orientation = _triple(model.geom_pos[number]), _quaternion(model.geom_quat[number])
    if kind in SIMPLE:
        return Geom(shape=SIMPLE[kind], size=size, position=position, orientation=orientation, rgba=rgba)  # type: ignore[arg-type]
    if kind == ELLIPSOID:
        radius = (size[0] * size[1] * size[2]) ** (1 / 3)
        return Geom(shape="sphere", size=(radius, 0.0, 0.0), position=position, rgba=rgba)
    if kind == PLANE:
        extent = float(model.stat.extent)
        thick = extent * THICKNESS
        wide, long = (half or 3 * extent for half in size[:2])
        sunk = _placed(position, orientation, (0.0, 0.0, -thick))
        return Geom(shape="box", size=(wide, long, thick), position=sunk, orientation=orientation, rgba=rgba)
    # Meshes and height fields are not sent: the box around them stands for them.
    box = [float(part) for part in model.geom_aabb[number]]
    middle, half = (box[0], box[1], box[2]), (box[3], box[4], box[5])
    return Geom(
        shape="box", size=half, position=_placed(position, orientation, middle), orientation=orientation, rgba=rgba
    )


def _placed(position: Vector, orientation: Quaternion, offset: Vector) -> Vector:
    w, x, y, z = orientation
    a, b, c = offset
    # v + 2 q × (q × v + w v)
    i, j, k = y * c - z * b + w * a, z * a - x * c + w * b, x * b - y * a + w * c
    return (
        position[0] + a + 2 * (y * k - z * j),
        position[1] + b + 2 * (z * i - x * k),
        position[2] + c + 2 * (x * j - y * i),
    )


def _triple(values: Any) -> Vector:
    x, y, z = (float(value) for value in values)
    return (x, y, z)


def _quaternion(values: Any) -> Quaternion:
    w, x, y, z = (float(value) for value in values)
    return (w, x, y, z)
