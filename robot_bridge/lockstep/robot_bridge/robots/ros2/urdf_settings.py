"""Takes from a URDF what the settings leave open: the bodies, and the limits of joints. No I/O."""

from collections.abc import Iterator

import msgspec

from lockstep.protocol.description import Body, BodyJoint, Geom
from lockstep.robot_bridge.robots.ros2.discovery.urdf import BadUrdf, Shape, Urdf, UrdfJoint, parse_urdf
from lockstep.robot_bridge.robots.ros2.settings import ArmJoint, Ros2Settings
from lockstep.robot_bridge.yaml_file import SettingsPlace

__all__ = ["with_urdf"]

BASE_BODY = "base"  # the body at the pose of the odometry
PREFIX = "link."  # of all links, where one of them has the name of that body
MOST_LINKS = 300


def with_urdf(settings: Ros2Settings, text: str) -> Ros2Settings:
    """Return the settings with the URDF's links as `bodies`, its ranges, and its speeds where they are slower.

    Raises:
        SettingsPlace: the URDF cannot be used, or does not fit the settings.
    """
    if settings.bodies:
        raise SettingsPlace(("bodies",), "the URDF gives the bodies: leave out one of the two")
    try:
        urdf = parse_urdf(text)
    except BadUrdf as error:
        raise SettingsPlace(("urdf",), f"it {error}") from error
    if len(urdf.links) > MOST_LINKS:
        raise SettingsPlace(("urdf",), f"it has {len(urdf.links)} links; at most {MOST_LINKS} can be described")
    prefix = PREFIX if settings.base is not None and BASE_BODY in urdf.links else ""
    arm = settings.arm
    if arm is not None:
        joints = tuple(_joint(joint, urdf, number) for number, joint in enumerate(arm.joints))
        tool = None if arm.tool is None else msgspec.structs.replace(arm.tool, tip=prefix + arm.tool.tip)
        arm = msgspec.structs.replace(arm, joints=joints, tool=tool)
    names = {joint.name for joint in arm.joints} if arm is not None else set[str]()
    names |= set(settings.servo.joints) if settings.servo is not None else set()
    bodies = tuple(_bodies(urdf, names, prefix, "" if settings.base is None else BASE_BODY))
    return msgspec.structs.replace(settings, arm=arm, bodies=bodies)


def _joint(joint: ArmJoint, urdf: Urdf, number: int) -> ArmJoint:
    found = urdf.joints.get(joint.name)
    place = ("arm", "joints", number, "name")
    if found is None or found.kind not in ("revolute", "continuous", "prismatic"):
        raise SettingsPlace(place, f"the URDF has no joint {joint.name} that moves")
    if (found.kind == "prismatic") != (joint.unit == "m"):
        raise SettingsPlace(place, f"in the URDF it is {found.kind}, which does not fit the unit {joint.unit}")
    if joint.lower is None and joint.upper is None:
        joint = msgspec.structs.replace(joint, lower=found.lower, upper=found.upper)
    if found.velocity is not None and 0 < found.velocity < joint.maximum:
        joint = msgspec.structs.replace(joint, maximum=found.velocity)
    return joint


def _bodies(urdf: Urdf, joints: set[str], prefix: str, root: str) -> Iterator[Body]:
    """Yield the links, parents first. Joints that are not among these stay at 0. `root`: on which the robot stands."""
    above = {joint.child: joint for joint in urdf.joints.values()}
    for name in sorted(urdf.links, key=lambda each: (len(urdf.chain(each)), each)):
        joint = above.get(name)
        link = urdf.links[name]
        shapes = next((found for found in map(_simple, (link.visual, link.collision)) if found), ())
        if joint is None:
            yield Body(name=prefix + name, parent=root, geoms=shapes)
            continue
        yield Body(
            name=prefix + name,
            parent=prefix + joint.parent,
            position=joint.pose.position,
            orientation=joint.pose.orientation,
            joints=(_moves(joint),) if joint.name in joints else (),
            geoms=shapes,
        )


def _moves(joint: UrdfJoint) -> BodyJoint:
    return BodyJoint(joint=joint.name, kind="prismatic" if joint.kind == "prismatic" else "revolute", axis=joint.axis)


def _simple(shapes: tuple[Shape, ...]) -> tuple[Geom, ...]:
    return tuple(
        Geom(shape=each.shape, size=each.size, position=each.pose.position, orientation=each.pose.orientation)
        for each in shapes
        if each.shape != "mesh"
    )
