"""Reads a robot's URDF: its joints with their limits, its links with simple shapes. No I/O.

The text comes from a topic. A document type, which could define entities that grow without bound, is refused.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, NamedTuple
from xml.etree.ElementTree import Element, ParseError, TreeBuilder
from xml.parsers import expat

from lockstep.robot_bridge.robots.ros2.discovery.pose import Pose, from_rpy

__all__ = ["BadUrdf", "Mesh", "Shape", "Urdf", "UrdfJoint", "UrdfLink", "parse_urdf"]

MAX_CHARACTERS = 4 << 20
MAX_PARTS = 2000  # links or joints
MAX_NAME = 200

Vector = tuple[float, float, float]


class BadUrdf(ValueError):
    """The text is not a URDF that can be used; the message says why."""


class Mesh(NamedTuple):
    """A mesh with few triangles, in its own frame and units."""

    vertices: list[Vector]
    triangles: list[tuple[int, int, int]]  # numbers of vertices


class Shape(NamedTuple):
    shape: Literal["box", "cylinder", "sphere", "mesh"]
    size: Vector  # as in `Geom`; of a mesh its scale
    pose: Pose
    mesh: str = ""  # "package://robot/meshes/base.stl"


@dataclass(frozen=True)
class UrdfLink:
    name: str
    visual: tuple[Shape, ...]
    collision: tuple[Shape, ...]


@dataclass(frozen=True)
class UrdfJoint:
    name: str
    kind: str  # "revolute", "continuous", "prismatic", "fixed" …
    parent: str
    child: str
    pose: Pose  # of the child in the parent, at position 0
    axis: Vector
    lower: float | None  # rad or m
    upper: float | None
    velocity: float | None  # rad/s or m/s
    mimics: bool


@dataclass(frozen=True)
class Urdf:
    name: str
    links: dict[str, UrdfLink]
    joints: dict[str, UrdfJoint]

    @property
    def root(self) -> str:
        """The link that is no joint's child."""
        children = {joint.child for joint in self.joints.values()}
        return next(name for name in self.links if name not in children)

    def chain(self, link: str) -> list[UrdfJoint]:
        """Return the joints from the root to a link, the root's first."""
        above = {joint.child: joint for joint in self.joints.values()}
        found = []
        while (joint := above.get(link)) is not None:
            found.append(joint)
            link = joint.parent
        return found[::-1]

    def pose(self, link: str) -> Pose | None:
        """Return a link's pose in the root's frame; None if there is no such link, or a joint moves it."""
        if link not in self.links:
            return None
        pose = Pose()
        for joint in self.chain(link):
            if joint.kind != "fixed":
                return None
            pose = pose.then(joint.pose)
        return pose


def parse_urdf(text: str) -> Urdf:
    """Read a URDF.

    Raises:
        BadUrdf: the text is no XML, has a document type, or its links are no tree.
    """
    if len(text) > MAX_CHARACTERS:
        raise BadUrdf("is longer than 4 MiB")
    robot = _root(text)
    if robot.tag != "robot":
        raise BadUrdf("has no element <robot>")
    links = {link.name: link for link in map(_link, robot.findall("link"))}
    joints = {joint.name: joint for joint in map(_joint, robot.findall("joint"))}
    if not links or max(len(links), len(joints)) > MAX_PARTS:
        raise BadUrdf(f"has no link, or more than {MAX_PARTS} links or joints")
    urdf = Urdf(robot.get("name", "")[:MAX_NAME], links, joints)
    _check_tree(urdf)
    return urdf


def _root(text: str) -> Element:
    builder = TreeBuilder()
    parser = expat.ParserCreate()

    def refuse(*_: object) -> None:
        raise BadUrdf("has a document type, which a URDF does not need")

    parser.StartDoctypeDeclHandler = refuse
    parser.StartElementHandler = builder.start
    parser.EndElementHandler = builder.end
    try:
        parser.Parse(text, True)
        return builder.close()
    except (expat.ExpatError, ParseError, AssertionError) as error:
        raise BadUrdf(f"is not XML ({error})") from error


def _check_tree(urdf: Urdf) -> None:
    children = [joint.child for joint in urdf.joints.values()]
    known = all({joint.parent, joint.child} <= urdf.links.keys() for joint in urdf.joints.values())
    if not known or len(set(children)) != len(children) or len(children) != len(urdf.links) - 1:
        raise BadUrdf("has links that are no tree")
    below: dict[str, list[str]] = {}
    for joint in urdf.joints.values():
        below.setdefault(joint.parent, []).append(joint.child)
    reached, open_links = set[str](), [urdf.root]
    while open_links:
        link = open_links.pop()
        reached.add(link)
        open_links += below.get(link, [])
    if len(reached) != len(urdf.links):
        raise BadUrdf("has joints in a circle")


def _link(element: Element) -> UrdfLink:
    return UrdfLink(_name(element), tuple(_shapes(element, "visual")), tuple(_shapes(element, "collision")))


def _shapes(link: Element, what: str) -> Iterator[Shape]:
    for each in link.findall(what):
        pose = _pose(each)
        for geometry in each.findall("geometry/*"):
            if geometry.tag == "box":
                x, y, z = _vector(geometry, "size")
                yield Shape("box", (x / 2, y / 2, z / 2), pose)
            elif geometry.tag == "cylinder":
                yield Shape("cylinder", (_number(geometry, "radius"), _number(geometry, "length") / 2, 0.0), pose)
            elif geometry.tag == "sphere":
                yield Shape("sphere", (_number(geometry, "radius"), 0.0, 0.0), pose)
            elif geometry.tag == "mesh":
                yield Shape("mesh", _vector(geometry, "scale", "1 1 1"), pose, geometry.get("filename", "")[:1000])


def _joint(element: Element) -> UrdfJoint:
    kind = element.get("type", "")
    limit, axis = element.find("limit"), element.find("axis")
    bounded = limit is not None and kind in ("revolute", "prismatic")
    return UrdfJoint(
        name=_name(element),
        kind=kind,
        parent=_link_of(element, "parent"),
        child=_link_of(element, "child"),
        pose=_pose(element),
        axis=(1.0, 0.0, 0.0) if axis is None else _unit(_vector(axis, "xyz", "1 0 0")),
        lower=_number(limit, "lower", "0") if bounded and limit is not None else None,
        upper=_number(limit, "upper", "0") if bounded and limit is not None else None,
        velocity=None if limit is None else (_number(limit, "velocity", "0") or None),
        mimics=element.find("mimic") is not None,
    )


def _name(element: Element) -> str:
    name = element.get("name", "")
    if not 0 < len(name) <= MAX_NAME or not name.isprintable():
        raise BadUrdf(f"has a {element.tag} without a usable name")
    return name


def _link_of(joint: Element, what: str) -> str:
    found = joint.find(what)
    return "" if found is None else found.get("link", "")


def _pose(element: Element) -> Pose:
    origin = element.find("origin")
    if origin is None:
        return Pose()
    return Pose(_vector(origin, "xyz", "0 0 0"), from_rpy(*_vector(origin, "rpy", "0 0 0")))


def _vector(element: Element, key: str, default: str = "") -> Vector:
    values = [_float(part, element, key) for part in element.get(key, default).split()]
    if len(values) != 3:
        raise BadUrdf(f"has a <{element.tag}> whose {key} is not three numbers")
    return values[0], values[1], values[2]


def _number(element: Element, key: str, default: str = "") -> float:
    return _float(element.get(key, default), element, key)


def _float(text: str, element: Element, key: str) -> float:
    try:
        value = float(text)
    except ValueError as error:
        raise BadUrdf(f"has a <{element.tag}> whose {key} is not a number") from error
    if not abs(value) <= 1e6:  # also not a number
        raise BadUrdf(f"has a <{element.tag}> whose {key} is beyond any robot")
    return value


def _unit(vector: Vector) -> Vector:
    length = math.hypot(*vector)
    if length < 1e-9:
        raise BadUrdf("has a joint whose axis has no direction")
    x, y, z = vector
    return x / length, y / length, z / length
