"""Drafts the `bodies` of a robot's file from its URDF, for the 3D scene.

The description knows boxes, spheres, cylinders and capsules. A link with meshes alone is drawn as the boxes around
them, where their files can be read.
"""

from collections.abc import Callable

from lockstep.robot_bridge.robots.ros2.discovery.drafting.yaml_text import Plain, Section, Value
from lockstep.robot_bridge.robots.ros2.discovery.pose import Pose
from lockstep.robot_bridge.robots.ros2.discovery.urdf import Box, Shape, Urdf, UrdfJoint, UrdfLink

__all__ = ["BASE_BODY", "LINK_PREFIX", "FindBox", "draft_bodies"]

BASE_BODY = "base"  # the body at the pose of the odometry
LINK_PREFIX = "link."  # of all links, where one of them has the name of that body
MAX_BODIES = 200
THINNEST = 0.001  # m, half of it: a mesh may be flat

FindBox = Callable[[str], Box | None]
SAME = 1e-9


def draft_bodies(urdf: Urdf, joints: set[str], find_box: FindBox, *, has_base: bool) -> Section | None:
    """Return the links as bodies; None if no link has a shape that can be drawn, or there are too many.

    `joints`: those that the robot's description has. The others stay at 0. `find_box`: of a mesh, by its name.
    """
    shapes = {name: _simple(link) for name, link in urdf.links.items()}
    boxed = {name: _boxes(link, find_box) for name, link in urdf.links.items() if not shapes[name]}
    boxed = {name: found for name, found in boxed.items() if found}
    shapes |= boxed
    needed = set[str]()
    for name, found in shapes.items():
        if found:
            needed |= {name, *(joint.parent for joint in urdf.chain(name))}
    if not needed or len(needed) > MAX_BODIES:
        return None
    prefix = LINK_PREFIX if has_base and BASE_BODY in needed else ""
    above = {joint.child: joint for joint in urdf.joints.values()}
    order = sorted(needed, key=lambda name: (len(urdf.chain(name)), name))  # parents first
    section = Section(head=["From the URDF, for the 3D scene: links with boxes, cylinders and spheres."])
    if boxed:
        section.head.append(f"Drawn as the boxes around their meshes: {', '.join(sorted(boxed)[:12])}")
    left_out = sorted(name for name, link in urdf.links.items() if not shapes[name] and (link.visual or link.collision))
    if left_out:
        section.head.append(
            f"Links with meshes that could not be read, which are not drawn: {', '.join(left_out[:12])}"
        )
    for name in order:
        joint = above.get(name)
        section.items.append(_body(name, joint, shapes[name], joints, prefix, BASE_BODY if has_base else ""))
    return section


def _body(name: str, joint: UrdfJoint | None, shapes: list[Shape], joints: set[str], prefix: str, world: str) -> Value:
    row: dict[str, Plain] = {"name": prefix + name, "parent": world if joint is None else prefix + joint.parent}
    if joint is not None:
        row |= _placed(joint.pose.position, joint.pose.orientation)
        if joint.name in joints:
            kind = "prismatic" if joint.kind == "prismatic" else "revolute"
            row["joints"] = [{"joint": joint.name, "kind": kind, "axis": list(joint.axis)}]
    if shapes:
        row["geoms"] = [
            {"shape": shape.shape, "size": list(shape.size)} | _placed(shape.pose.position, shape.pose.orientation)
            for shape in shapes
        ]
    return Value(row)


def _placed(position: tuple[float, ...], orientation: tuple[float, ...]) -> dict[str, Plain]:
    placed: dict[str, Plain] = {}
    if any(abs(value) > SAME for value in position):
        placed["position"] = list(position)
    if abs(orientation[0]) < 1 - SAME:
        placed["orientation"] = list(orientation)
    return placed


def _boxes(link: UrdfLink, find_box: FindBox) -> list[Shape]:
    """Return the boxes around the link's meshes: of the visible ones, else of those of the collision model."""
    for shapes in (link.visual, link.collision):
        found = [_box_of(shape, box) for shape in shapes if shape.mesh and (box := find_box(shape.mesh)) is not None]
        if found:
            return found
    return []


def _box_of(shape: Shape, box: Box) -> Shape:
    x, y, z = (centre * scale for centre, scale in zip(box.centre, shape.size, strict=True))
    a, b, c = (max(abs(half * scale), THINNEST) for half, scale in zip(box.half, shape.size, strict=True))
    return Shape("box", (a, b, c), shape.pose.then(Pose((x, y, z))))


def _simple(link: UrdfLink) -> list[Shape]:
    """Return the visible shapes that are simple; else those of the collision model."""
    for shapes in (link.visual, link.collision):
        simple = [shape for shape in shapes if shape.shape != "mesh"]
        if simple:
            return simple
    return []
