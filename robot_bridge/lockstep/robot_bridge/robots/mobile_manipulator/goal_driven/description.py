"""Describes the arm of the mobile manipulator where it is driven by goals."""

from collections.abc import Sequence
from typing import Final, NamedTuple

import msgspec

from lockstep.protocol.description import Axis, AxisGain, Binding, Body, ControlLayer, Joint, Pose, PositionLimit
from lockstep.robot_bridge.kinematics.chain import Chain
from lockstep.robot_bridge.robots.mobile_manipulator.simulation import ARM, MOUNT
from lockstep.robot_bridge.robots.stick_bindings import leftwards, upwards
from lockstep.robot_bridge.robots.tool_pose.axes import ToolAxes, tool_axes, tool_layer
from lockstep.robot_bridge.robots.tool_pose.posed_tool import tool_pose

__all__ = ["RATES", "ArmDescription", "arm_chain", "describe_arm"]

TIP: Final = (0.17, 0.0, 0.0)  # m, in the tool's frame
RATES: Final = (1.5, 1.5, 1.8, 2.5, 2.5, 3.0)  # rad/s, of each joint at most
SHARE: Final = 0.6  # of these, at which the joints' own goals move
REACH: Final = 0.7  # rad
STOPS_IN, SPEEDS_UP_IN = 0.15, 0.25  # s


class ArmDescription(NamedTuple):
    joints: tuple[Axis, ...]
    axes: ToolAxes
    pose: Pose
    layers: tuple[ControlLayer, ...]
    limits: tuple[PositionLimit, ...]


def arm_chain(bodies: Sequence[Body]) -> Chain:
    """Return the chain from the arm's mount, in whose frame its pose is, to the tool's tip."""
    return Chain(bodies, "tool", MOUNT, TIP)


def describe_arm(joints: Sequence[Joint], bodies: Sequence[Body]) -> ArmDescription:
    """Return the arm's part of the description. `joints`, `bodies`: of the whole robot."""
    chain = arm_chain(bodies)
    own = tuple(_goal_axis(joint, rate) for joint, rate in zip(joints[ARM], RATES, strict=True))
    axes = tool_axes("tool", "Tool", chain.begins.tolist(), chain.length)
    names = [axis.name for axis in own]
    pose = msgspec.structs.replace(tool_pose("tool", "Tool", "tool", axes, names, MOUNT), point=TIP)
    x, y, z = (axis.name for axis in axes.position)
    drive = ControlLayer(
        name="drive",
        label="Drive",
        bindings=(
            upwards("base.vx", "left_y", "left_y", ("KeyW", "KeyS")),
            leftwards("base.vy", "left_x", "left_x", ("KeyA", "KeyD")),
            leftwards("base.wz", "right_x", "right_x", ("KeyQ", "KeyE")),
            upwards(z, "right_y", "right_y", ("KeyR", "KeyF")),
            Binding(axis=x, pad="triggers", key_positive="ArrowUp", key_negative="ArrowDown"),
            Binding(axis=y, pad="dpad_x", invert_pad=True, key_positive="ArrowLeft", key_negative="ArrowRight"),
        ),
    )
    forward = Binding(axis="base.vx", pad="triggers", key_positive="KeyT", key_negative="KeyG", scale=0.5)
    return ArmDescription(
        own,
        axes,
        pose,
        (drive, tool_layer("arm", "Tool", axes.names, forward), _joint_layer(names)),
        tuple(_limit(joint) for joint in joints[ARM] if joint.minimum is not None or joint.maximum is not None),
    )


def _goal_axis(joint: Joint, rate: float) -> Axis:
    low = -3.14159 if joint.minimum is None else joint.minimum
    high = 3.14159 if joint.maximum is None else joint.maximum
    fastest = SHARE * rate
    return Axis(
        name=joint.name,
        label=joint.name.removeprefix("arm.").capitalize(),
        unit="rad",
        minimum=low,
        maximum=high,
        kind="goal",
        slew=round(fastest, 5),
        acceleration=round(fastest / SPEEDS_UP_IN, 5),
        brake=round(fastest / STOPS_IN, 5),
        reach=REACH,
    )


def _joint_layer(names: Sequence[str]) -> ControlLayer:
    waist, shoulder, elbow, roll, bend, twist = names
    return ControlLayer(
        name="joints",
        label="Joints",
        bindings=(
            leftwards(waist, "left_x", "left_x", ("KeyA", "KeyD")),
            upwards(shoulder, "left_y", "left_y", ("KeyW", "KeyS")),
            upwards(elbow, "right_y", "right_y", ("KeyR", "KeyF")),
            leftwards(roll, "right_x", "right_x", ("KeyQ", "KeyE")),
            Binding(axis=bend, pad="dpad_y", key_positive="ArrowDown", key_negative="ArrowUp"),
            Binding(axis=twist, pad="dpad_x", key_positive="ArrowRight", key_negative="ArrowLeft"),
        ),
    )


def _limit(joint: Joint) -> PositionLimit:
    return PositionLimit(
        name=joint.name,
        label=f"{joint.name.removeprefix('arm.').capitalize()} range",
        joint=joint.name,
        minimum=joint.minimum,
        maximum=joint.maximum,
        axes=(AxisGain(axis=joint.name),),
    )
