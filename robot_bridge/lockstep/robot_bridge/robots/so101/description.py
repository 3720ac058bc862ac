"""The arm's description for a console."""

from collections.abc import Sequence
from typing import Any, Final

import msgspec

from lockstep.protocol.description import (
    Action,
    AxisGain,
    Body,
    Camera,
    ForceFeeling,
    Joint,
    Pose,
    PositionLimit,
    RobotDescription,
    WrenchSensor,
)
from lockstep.robot_bridge.robots.mujoco_bodies import describe_body, rounded
from lockstep.robot_bridge.robots.mujoco_view.camera_view import camera_view
from lockstep.robot_bridge.robots.so101.arm_drive import SETTLES
from lockstep.robot_bridge.robots.so101.contact_force import HAND
from lockstep.robot_bridge.robots.so101.controls import AXES, LAYERS
from lockstep.robot_bridge.robots.so101.model import ARM, JOINT_NAMES, LINKS, PREFIX, TOOL, TOOL_POINT

__all__ = ["CAMERAS", "TOOL_BODY", "describe", "describe_bodies"]

CAMERAS: Final = (  # names are those of the model's cameras
    Camera(name="overview", label="Overview", width=640, height=480, frame_rate=30.0),
    Camera(name="arm.gripper", label="Gripper", width=320, height=240, frame_rate=15.0),
)
TOOL_BODY: Final = "arm.tool"
TOOL_TURN: Final = (0.70711, 0.0, 0.70711, 0.0)  # from the hand's frame: x away from the gripper
TABLE_GROUPS: Final = (1,)
ARM_GROUPS: Final = (3, 4)  # hulls: the meshes are not sent, and a hull is what the arm touches things with
YELLOW, DARK = (1.0, 0.82, 0.12, 1.0), (0.2, 0.2, 0.22, 1.0)
DIGITS: Final = 6

WRENCH: Final = WrenchSensor(
    name="contact", body=HAND, threshold_force=0.4, full_scale_force=15.0, full_scale_torque=2.0
)
FEELING: Final = ForceFeeling(threshold_newtons=0.4, full_newtons=10.0, curve=0.6)
TOOL_POSE: Final = Pose(
    name=TOOL,
    label="Tool",
    body=TOOL_BODY,
    position=("tool.x", "tool.y", "tool.z"),
    rotation=("tool.rx", "tool.ry", "tool.rz"),
    instead_of=JOINT_NAMES[ARM],
    settling=SETTLES,
)
ACTIONS: Final = (
    Action(name="home", label="Home"),
    Action(name="fold", label="Fold"),
    Action(name="open_gripper", label="Open gripper"),
    Action(name="reset_scene", label="Reset scene", moves=False),
)


def describe(model: Any) -> RobotDescription:
    """Return the description that belongs to the compiled model."""
    joints = tuple(describe_joint(model, name) for name in JOINT_NAMES)
    return RobotDescription(
        name="so101",
        label="SO-101 (MuJoCo)",
        axes=AXES,
        joints=joints,
        layers=LAYERS,
        cameras=tuple(with_view(model, camera) for camera in CAMERAS),
        wrench=WRENCH,
        force_feeling=FEELING,
        actions=ACTIONS,
        bodies=describe_bodies(model),
        poses=(TOOL_POSE,),
        position_limits=limits(joints),
        hold=0.3,
        watchdog=0.25,  # a simulation hurts no person, and busy machines hold it up
        max_event_age=2.0,
        max_event_rate=60.0,
    )


def with_view(model: Any, camera: Camera) -> Camera:
    number = model.camera(camera.name).id
    body = model.body(model.cam_bodyid[number]).name if model.cam_bodyid[number] else ""
    return msgspec.structs.replace(camera, view=camera_view(model, number, camera, body))


def limits(joints: Sequence[Joint]) -> tuple[PositionLimit, ...]:
    """Return a limit for each joint of the arm, for its own axis; the inverse kinematics keeps them for the tool's."""
    return tuple(
        PositionLimit(
            name=joint.name,
            label=f"{joint.name.replace('_', ' ').capitalize()} range",
            joint=joint.name,
            minimum=joint.minimum,
            maximum=joint.maximum,
            axes=(AxisGain(axis=joint.name),),
        )
        for joint in joints[ARM]
    )


def describe_joint(model: Any, name: str) -> Joint:
    lower, upper = rounded(model.jnt_range[model.joint(PREFIX + name).id], DIGITS)
    return Joint(name=name, unit="rad", minimum=lower, maximum=upper)


def describe_bodies(model: Any) -> tuple[Body, ...]:
    """Return the table, the arm's links, parents first, and the tool.

    Blocks and bowl are left out: feedback does not say where they are.
    """
    table = describe_body(model, model.body("table").id, TABLE_GROUPS, DIGITS)
    links = (
        describe_body(model, model.body(PREFIX + name).id, ARM_GROUPS, DIGITS, prefix=PREFIX, colour=hull_colour)
        for name in LINKS
    )
    tool = Body(name=TOOL_BODY, parent=HAND, position=TOOL_POINT, orientation=TOOL_TURN)
    return (table, *links, tool)


def hull_colour(model: Any, geom: int) -> Any:
    """Return the colour of a hull: fingertips have their own."""
    return DARK if model.geom_group[geom] == 4 else YELLOW
