"""Drafts the `bodies` of a robot's file from its URDF, for the 3D scene.

A link with simple shapes is drawn by them, another by its meshes, where their files can be read. Meshes have as few
triangles as a description has room for.
"""

import math
from collections.abc import Callable

from lockstep.robot_bridge.robots.ros2.discovery.drafting.yaml_text import Plain, Section, Value
from lockstep.robot_bridge.robots.ros2.discovery.urdf import Mesh, Shape, Urdf, UrdfJoint, UrdfLink

__all__ = ["BASE_BODY", "LINK_PREFIX", "MOST_FRAMES", "FindMesh", "draft_bodies"]

BASE_BODY = "base"  # the body at the pose of the odometry
LINK_PREFIX = "link."  # of all links, where one of them has the name of that body
MAX_BODIES = 200
MOST_FRAMES = 40  # bodies that nothing is drawn by; some 200 bytes of a description each
ROOM, VERTEX = 30_000, 40  # bytes of a description for all meshes, and for each vertex with its triangles
LEAST_VERTICES, MOST_VERTICES = 8, 150  # of a mesh

FindMesh = Callable[[str, int], Mesh | None]  # by its name, with at most so many vertices
Drawn = dict[str, Plain]  # a geom of the file
SAME = 1e-9
DIGITS = 4  # of a metre


def draft_bodies(urdf: Urdf, joints: set[str], find_mesh: FindMesh, *, has_base: bool) -> Section | None:
    """Return the links as bodies; None if no link has a shape that can be drawn, or there are too many.

    `joints`: those that the robot's description has. The others stay at 0. `find_mesh`: returns None for one
    that cannot be read.
    """
    shapes: dict[str, list[Drawn]] = {name: _simple(link) for name, link in urdf.links.items()}
    others = [name for name, found in shapes.items() if not found]
    count = sum(len(urdf.links[name].visual) or len(urdf.links[name].collision) for name in others)
    most = min(MOST_VERTICES, max(LEAST_VERTICES, ROOM // VERTEX // max(1, count)))
    meshed = {name: found for name in others if (found := _meshes(urdf.links[name], find_mesh, most))}
    shapes |= meshed
    needed = set[str]()
    for name, found in shapes.items():
        if found:
            needed |= {name, *(joint.parent for joint in urdf.chain(name))}
    if not needed or len(needed) > MAX_BODIES:
        return None
    # Frames without a shape, such as `tool0`: the tip of a tool is often one.
    frames = {name for name in urdf.links if any(joint.name in joints for joint in urdf.chain(name))}
    frames |= {joint.parent for name in frames for joint in urdf.chain(name)}
    if len(frames - needed) <= MOST_FRAMES and len(needed | frames) <= MAX_BODIES:
        needed |= frames
    prefix = LINK_PREFIX if has_base and BASE_BODY in needed else ""
    above = {joint.child: joint for joint in urdf.joints.values()}
    order = sorted(needed, key=lambda name: (len(urdf.chain(name)), name))  # parents first
    section = Section(head=["From the URDF, for the 3D scene: links with boxes, cylinders and spheres."])
    if meshed:
        section.head.append(f"Drawn by their meshes, with at most {most} corners: {', '.join(sorted(meshed)[:12])}")
    left_out = sorted(name for name, link in urdf.links.items() if not shapes[name] and (link.visual or link.collision))
    if left_out:
        section.head.append(
            f"Links with meshes that could not be read, which are not drawn: {', '.join(left_out[:12])}"
        )
    for name in order:
        joint = above.get(name)
        section.items.append(_body(name, joint, shapes[name], joints, prefix, BASE_BODY if has_base else ""))
    return section


def _body(name: str, joint: UrdfJoint | None, shapes: list[Drawn], joints: set[str], prefix: str, world: str) -> Value:
    row: dict[str, Plain] = {"name": prefix + name, "parent": world if joint is None else prefix + joint.parent}
    if joint is not None:
        row |= _placed(joint.pose.position, joint.pose.orientation)
        if joint.name in joints:
            kind = "prismatic" if joint.kind == "prismatic" else "revolute"
            row["joints"] = [{"joint": joint.name, "kind": kind, "axis": list(joint.axis)}]
    if shapes:
        row["geoms"] = shapes
    return Value(row)


def _placed_as(shape: Shape) -> Drawn:
    return _placed(shape.pose.position, shape.pose.orientation)


def _placed(position: tuple[float, ...], orientation: tuple[float, ...]) -> dict[str, Plain]:
    placed: dict[str, Plain] = {}
    if any(abs(value) > SAME for value in position):
        placed["position"] = list(position)
    if abs(orientation[0]) < 1 - SAME:
        placed["orientation"] = list(orientation)
    return placed


def _meshes(link: UrdfLink, find_mesh: FindMesh, most: int) -> list[Drawn]:
    """Return the link's meshes: the visible ones, else those of the collision model."""
    for shapes in (link.visual, link.collision):
        found = [(shape, find_mesh(shape.mesh, most)) for shape in shapes if shape.mesh]
        if drawn := [_mesh(shape, mesh) for shape, mesh in found if mesh is not None]:
            return drawn
    return []


def _mesh(shape: Shape, mesh: Mesh) -> Drawn:
    """Return a mesh in metres, with its scale in it. One that is mirrored by that has its triangles turned over."""
    scale = shape.size
    vertices = [round(value * by, DIGITS) for vertex in mesh.vertices for value, by in zip(vertex, scale, strict=True)]
    step = -1 if math.prod(scale) < 0 else 1
    corners = [number for triangle in mesh.triangles for number in triangle[::step]]
    drawn: Drawn = {"shape": "mesh", "vertices": vertices, "triangles": corners}
    return drawn | _placed_as(shape)


def _simple(link: UrdfLink) -> list[Drawn]:
    """Return the visible shapes that are simple; else those of the collision model."""
    for shapes in (link.visual, link.collision):
        simple = [shape for shape in shapes if shape.shape != "mesh"]
        if simple:
            return [{"shape": each.shape, "size": list(each.size)} | _placed_as(each) for each in simple]
    return []
