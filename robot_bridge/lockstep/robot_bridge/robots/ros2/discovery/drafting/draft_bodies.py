"""Drafts the `bodies` of a robot's file from its URDF, for the 3D scene.

The description knows boxes, spheres, cylinders and capsules. A mesh is left out where its link has a simple shape as
well; else the link has no shape.
"""

from lockstep.robot_bridge.robots.ros2.discovery.drafting.yaml_text import Plain, Section, Value
from lockstep.robot_bridge.robots.ros2.discovery.urdf import Shape, Urdf, UrdfJoint, UrdfLink

__all__ = ["draft_bodies"]

BASE_BODY = "base"  # the body at the pose of the odometry
MAX_BODIES = 200
SAME = 1e-9


def draft_bodies(urdf: Urdf, joints: set[str], *, has_base: bool) -> Section | None:
    """Return the links as bodies; None if no link has a simple shape, or there are too many.

    `joints`: those that the robot's description has. The others stay at 0.
    """
    shapes = {name: _shapes(link) for name, link in urdf.links.items()}
    needed = set[str]()
    for name, found in shapes.items():
        if found:
            needed |= {name, *(joint.parent for joint in urdf.chain(name))}
    if not needed or len(needed) > MAX_BODIES:
        return None
    prefix = "link." if has_base and BASE_BODY in needed else ""
    above = {joint.child: joint for joint in urdf.joints.values()}
    order = sorted(needed, key=lambda name: (len(urdf.chain(name)), name))  # parents first
    section = Section(head=["From the URDF, for the 3D scene: links with boxes, cylinders and spheres."])
    left_out = sorted(name for name, link in urdf.links.items() if not shapes[name] and (link.visual or link.collision))
    if left_out:
        section.head.append(f"Links with meshes alone, which are not drawn: {', '.join(left_out[:12])}")
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


def _shapes(link: UrdfLink) -> list[Shape]:
    """Return the visible shapes that are simple; else those of the collision model."""
    for shapes in (link.visual, link.collision):
        simple = [shape for shape in shapes if shape.shape != "mesh"]
        if simple:
            return simple
    return []
