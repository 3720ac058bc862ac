"""Makes the pose of an arm's tool from the settings: its axes, its body, and the inverse kinematics."""

import math
from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np

from lockstep.protocol.description import Body, CameraCalibration, ControlLayer, Pose, RobotDescription
from lockstep.robot_bridge.kinematics.body_capsules import body_capsules
from lockstep.robot_bridge.kinematics.capsules import separate_pairs
from lockstep.robot_bridge.kinematics.chain import Chain, NoChain
from lockstep.robot_bridge.kinematics.clearance import Clearance
from lockstep.robot_bridge.kinematics.obstacles import Obstacle, Obstacles, plane
from lockstep.robot_bridge.kinematics.pose_solver import JointBounds
from lockstep.robot_bridge.kinematics.rotations import quaternion
from lockstep.robot_bridge.kinematics.surfaces import body_surfaces
from lockstep.robot_bridge.kinematics.views import View, view_from
from lockstep.robot_bridge.robots.ros2.settings import Arm, ToolObstacle
from lockstep.robot_bridge.robots.tool_pose.arm_solver import tool_solver
from lockstep.robot_bridge.robots.tool_pose.axes import ToolAxes, picture_layer, shortest_hold, tool_axes, tool_layer
from lockstep.robot_bridge.robots.tool_pose.posed_tool import PosedTool, ToolPlace, tool_pose
from lockstep.robot_bridge.yaml_file import SettingsPlace

__all__ = ["ToolDescription", "arm_tool", "describe_tool"]

NAME: Final = "tool"
FEWEST: Final = 3  # joints
FARTHEST: Final = 1e6  # m, of an obstacle
KEYS: Final = ("arm", "tool")


class ToolDescription(NamedTuple):
    """What a tool adds to the robot's description."""

    axes: ToolAxes
    body: Body
    pose: Pose
    layer: ControlLayer


Cameras = Mapping[str, CameraCalibration | None]  # by name


def describe_tool(arm: Arm, bodies: Sequence[Body], cameras: Cameras, hold: float) -> ToolDescription:
    """Return the tool's part of the description. `bodies`: of the robot.

    Raises:
        SettingsPlace: the tool has no chain of joints, or the settings contradict each other.
    """
    tool = arm.tool
    if tool is None:
        raise ValueError("the arm has no tool")
    if hold < shortest_hold():
        raise SettingsPlace((*KEYS, "tip"), f"a tool needs a hold of {shortest_hold():g} s at least, not {hold:g} s")
    joints = {joint.name: number for number, joint in enumerate(arm.joints)}
    base = _base(bodies, tool.tip, set(joints))
    view = _view(tool.frame, bodies, cameras, base)
    root, seen = ("", view.bodies(bodies)) if view is not None else (base, list(bodies))  # of the pose's frame
    try:
        chain = Chain(seen, tool.tip, root)
    except NoChain as error:
        raise SettingsPlace((*KEYS, "tip"), str(error)) from error
    if len(chain.joints) < FEWEST:
        found = f"between {tool.tip} and {base or 'the world'} are {len(chain.joints)} joints of the arm"
        raise SettingsPlace(
            (*KEYS, "tip"),
            f"{found}; a pose needs {FEWEST}",
        )
    if tool.posture and len(tool.posture) != len(arm.joints):
        raise SettingsPlace((*KEYS, "posture"), f"needs one value for each of the {len(arm.joints)} joints of the arm")
    for number, each in enumerate(tool.obstacles):
        for key, vector in (("position", each.position), ("normal", each.normal)):
            if not all(abs(value) <= FARTHEST for value in vector):  # of what is not a number nothing would be kept off
                raise SettingsPlace((*KEYS, "obstacles", number, key), f"needs numbers up to {FARTHEST:g}")
        if not any(each.normal):
            raise SettingsPlace((*KEYS, "obstacles", number, "normal"), "has no direction")
    turn = np.eye(3) if view is None else view.rotation
    if tool.posture:
        turn = chain.at([tool.posture[joints[name]] for name in chain.joints]).rotation.T
    body = Body(name=f"{tool.tip}.tool", parent=tool.tip, position=tool.point, orientation=quaternion(turn))
    chain = Chain((*seen, body), body.name, root)
    axes = tool_axes(NAME, "Tool", chain.begins.tolist(), chain.length, tool.linear, in_picture=view is not None)
    pose = tool_pose(NAME, "Tool", body.name, axes, [f"arm.{name}" for name in chain.joints], tool.frame or base)
    layer = tool_layer if view is None else picture_layer
    return ToolDescription(axes, body, pose, layer(NAME, "Tool", axes.names))


def arm_tool(arm: Arm, description: RobotDescription, measured: Sequence[float]) -> PosedTool:
    """Return the drive of the tool. Its values are numbered within the arm's axes. `measured`: of the arm's joints."""
    (pose,) = description.poses
    axes = {axis.name: axis for axis in description.axes}
    base = _base(description.bodies, pose.body, {joint.name for joint in arm.joints})
    cameras = {camera.name: camera.calibration for camera in description.cameras}
    frame = "" if arm.tool is None else arm.tool.frame
    view = _view(frame, description.bodies, cameras, base)
    root, seen = ("", view.bodies(description.bodies)) if view is not None else (base, list(description.bodies))
    chain = Chain(seen, pose.body, root)
    numbers = {joint.name: number for number, joint in enumerate(arm.joints)}
    places = tuple(numbers[name] for name in chain.joints)
    joints = [axes[f"arm.{name}"] for name in chain.joints]
    bounds = JointBounds(
        lower=tuple(-math.inf if axis.wrap else axis.minimum for axis in joints),
        upper=tuple(math.inf if axis.wrap else axis.maximum for axis in joints),
        rates=tuple(arm.joints[number].maximum for number in places),
    )
    posture = [measured[number] for number in places]
    given = arm.tool.posture if arm.tool is not None else ()
    home = [given[number] for number in places] if given else None
    capsules = body_capsules([body for body in seen if chain.has(body.name)])
    pairs = separate_pairs(chain, capsules, home or posture)
    obstacles = tuple(map(_obstacle, arm.tool.obstacles if arm.tool is not None else ()))
    if view is not None:
        obstacles = tuple(map(view.obstacle, obstacles))
    stands = Obstacles(chain, body_surfaces(seen, chain) if obstacles else {}, obstacles)
    return PosedTool(
        pose.name,
        ToolPlace(places, tuple(range(len(arm.joints), len(arm.joints) + 6))),
        chain,
        tool_solver(
            chain,
            bounds,
            ToolAxes(tuple(axes[name] for name in pose.position), tuple(axes[name] for name in pose.rotation)),
            keeps_off=(Clearance(chain, capsules, pairs), stands),
            posture=home,
            turns_first=arm.tool is not None and arm.tool.keeps == "rotation",
        ),
        bounds.rates,
        posture,
    )


def _view(name: str, bodies: Sequence[Body], cameras: Cameras, base: str) -> View | None:
    """Return the view of the camera in whose frame the pose is; None: it is in the base's.

    Raises:
        SettingsPlace: there is no such camera, nobody knows where it is, or it moves against the base.
    """
    if not name:
        return None
    where = (*KEYS, "frame")
    if name not in cameras:
        raise SettingsPlace(where, f"there is no camera {name!r}")
    found = cameras[name]
    if found is None:
        raise SettingsPlace(where, f"the camera {name!r} needs a calibration, which says where it is")
    if any(body.name == name for body in bodies):
        raise SettingsPlace(where, f"{name!r} is the name of a body too")
    try:
        return view_from(bodies, base, found.body, found.position, found.orientation)
    except ValueError as error:  # no chain, or no rotation
        raise SettingsPlace(where, str(error)) from error


def _obstacle(given: ToolObstacle) -> Obstacle:
    if given.size is None:
        return plane(given.name, given.position, given.normal)
    return Obstacle(given.name, np.array(given.position), np.eye(3), np.array(given.size) / 2.0)


def _base(bodies: Sequence[Body], tip: str, joints: set[str]) -> str:
    """Return the body on which the arm stands: the nearest one above that another joint moves; "": the world."""
    known = {body.name: body for body in bodies}
    name, seen = tip, 0
    while (body := known.get(name)) is not None and seen <= len(known):
        if any(joint.joint not in joints for joint in body.joints):
            return name
        name, seen = body.parent, seen + 1
    return ""
