"""Makes the pose of a model's tool: its axes, its body, and the inverse kinematics that drives the joints."""

from collections.abc import Sequence
from functools import partial
from typing import Any, Final, NamedTuple

import numpy as np

from lockstep.protocol.description import Axis, Binding, Body, ControlLayer, Pose
from lockstep.robot_bridge.errors import ModelError
from lockstep.robot_bridge.kinematics.capsules import separate_pairs
from lockstep.robot_bridge.kinematics.chain import Chain
from lockstep.robot_bridge.kinematics.clearance import Clearance, GapSource
from lockstep.robot_bridge.kinematics.obstacles import Obstacles
from lockstep.robot_bridge.kinematics.pose_solver import JointBounds
from lockstep.robot_bridge.kinematics.rotations import quaternion
from lockstep.robot_bridge.kinematics.views import View, view_from
from lockstep.robot_bridge.robots.mjcf.cameras import cameras_of
from lockstep.robot_bridge.robots.mjcf.drives import Drive
from lockstep.robot_bridge.robots.mjcf.names import label_of, name_of
from lockstep.robot_bridge.robots.mjcf.tools.capsules import capsules_of, may_touch
from lockstep.robot_bridge.robots.mjcf.tools.obstacles import OBSTACLES, obstacles_of, surfaces_of
from lockstep.robot_bridge.robots.mjcf.tools.tool_setting import TEXT, ModelTool
from lockstep.robot_bridge.robots.mujoco_view.calibration import calibrated
from lockstep.robot_bridge.robots.tool_pose.arm_solver import tool_solver
from lockstep.robot_bridge.robots.tool_pose.axes import picture_layer, tool_axes, tool_layer
from lockstep.robot_bridge.robots.tool_pose.posed_tool import PosedTool, ToolPlace, tool_pose

__all__ = ["ToolParts", "tool_parts"]

FASTER: Final = 4 / 3  # times the speed of a joint's own goal, at which it may follow the tool's
DIGITS: Final = 6


class ToolParts(NamedTuple):
    """What a tool adds to the robot."""

    axes: tuple[Axis, ...]
    body: Body  # the tool's frame
    pose: Pose
    layer: ControlLayer
    tool: PosedTool
    joints: tuple[int, ...]  # indices of the joints' positions in the state


def tool_parts(
    model: Any, data: Any, tool: ModelTool, drives: Sequence[Drive], bodies: Sequence[Body], first: int
) -> ToolParts:
    """Return the parts of one tool. `first`: number of its first axis. `data` has the model's first posture.

    Raises:
        ModelError: the model names obstacles that it has not, or for an arm that does not stand still; or a camera
            that does not stand where the arm does.
    """
    numbers = {drive.actuator.number: number for number, drive in enumerate(drives)}
    places = tuple(numbers[servo.number] for servo in tool.servos)
    own = [drives[number] for number in places]
    joints = [joint for servo in tool.servos if (joint := servo.joint) is not None]
    indices = tuple(int(model.jnt_qposadr[joint]) for joint in joints)
    posture = [float(data.qpos[index]) for index in indices]
    base = name_of(model, "body", tool.path[0]) if _moves(model, tool.path[0]) else ""
    view = _view(model, tool, bodies, base) if tool.camera else None
    root, seen = (base, list(bodies)) if view is None else ("", view.bodies(bodies))  # of the pose's frame
    body = _tool_body(model, tool, seen, root, posture)
    chain = Chain((*seen, body), body.name, root)
    label = label_of(tool.name)
    axes = tool_axes(tool.name, label, chain.begins.tolist(), chain.length, in_picture=view is not None)
    bounds = JointBounds(
        lower=tuple(-np.inf if drive.axis.wrap else drive.axis.minimum for drive in own),
        upper=tuple(np.inf if drive.axis.wrap else drive.axis.maximum for drive in own),
        rates=tuple(FASTER * drive.axis.slew for drive in own),
    )
    capsules = capsules_of(model, tool.path)
    pairs = separate_pairs(chain, capsules, posture, partial(may_touch, model))
    keeps_off: list[GapSource] = [Clearance(chain, capsules, pairs)]
    if obstacles := obstacles_of(model, data):
        if base:
            raise ModelError(f"{OBSTACLES} needs an arm that stands still, and {tool.name!r} stands on {base!r}")
        if view is not None:
            obstacles = tuple(map(view.obstacle, obstacles))
        keeps_off.append(Obstacles(chain, surfaces_of(model, data, tool.path), obstacles))
    solver = tool_solver(chain, bounds, axes, keeps_off=keeps_off, posture=posture)
    pose = tool_pose(tool.name, label, body.name, axes, [drive.axis.name for drive in own], tool.camera or base)
    layer = tool_layer if view is None else picture_layer
    place = ToolPlace(places, tuple(range(first, first + len(axes.all))))
    return ToolParts(
        axes.all,
        body,
        pose,
        layer(tool.name, label, axes.names, *_grip(model, tool, drives)),
        PosedTool(tool.name, place, chain, solver, bounds.rates, posture),
        indices,
    )


def _view(model: Any, tool: ModelTool, bodies: Sequence[Body], base: str) -> View:
    """Return the view of the tool's camera. `base`: on which the arm stands.

    Raises:
        ModelError: it is no stream, no pinhole that tells its place, or moves against the base.
    """
    where = f"{TEXT} names the camera {tool.camera!r}"
    camera = next((each for each in cameras_of(model) if each.name == tool.camera), None)
    if camera is None:
        raise ModelError(f"{where}, which is not among the first ones, that become streams")
    if tool.camera == tool.name or any(body.name == tool.camera for body in bodies):
        raise ModelError(f"{where}, which is the name of a body too: nobody knows which of the two is meant")
    found = calibrated(camera, model, bodies).calibration
    if found is None:
        raise ModelError(
            f"{where}, whose view or place is not known: it turns by itself (mode), has a sensorsize or no perspective,"
            " or hangs on a body that is not described"
        )
    try:
        return view_from(bodies, base, found.body, found.position, found.orientation)
    except ValueError as error:  # no chain, or no rotation
        raise ModelError(f"{where}: {error}") from error


def _moves(model: Any, body: int) -> bool:
    """Return whether a joint moves this body."""
    return int(model.body_weldid[body]) != 0


def _tool_body(model: Any, tool: ModelTool, bodies: Sequence[Body], base: str, posture: Sequence[float]) -> Body:
    """Return the tool's frame. It is turned so that its rotation is zero in the posture.

    A frame that points down, as most tools' own do, would be half a turn from zero, where a rotation vector has no
    unambiguous components.
    """
    parent = name_of(model, "body", tool.path[-1])
    point = (0.0, 0.0, 0.0) if tool.site is None else model.site_pos[tool.site].tolist()
    rotation = Chain(bodies, parent, base).at(posture).rotation
    x, y, z = (round(value, DIGITS) for value in point)
    names = {body.name for body in bodies}
    name = tool.name if tool.name not in names else f"{tool.name}.tool"
    return Body(name=name, parent=parent, position=(x, y, z), orientation=quaternion(rotation.T))


def _grip(model: Any, tool: ModelTool, drives: Sequence[Drive]) -> list[Binding]:
    """Bind the triggers to the first actuator that moves a joint of the hand."""
    hand = tool.path[-1]
    for drive in drives:
        joint = drive.actuator.joint
        if joint is None or drive.actuator in tool.servos:
            continue
        body = int(model.jnt_bodyid[joint])
        while body and body != hand:
            body = int(model.body_parentid[body])
        if body:
            return [Binding(axis=drive.axis.name, pad="triggers", key_positive="KeyT", key_negative="KeyG")]
    return []
