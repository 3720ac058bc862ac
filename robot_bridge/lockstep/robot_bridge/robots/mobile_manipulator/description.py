"""The mobile manipulator's description for a console."""

from typing import Any, Final

import msgspec

from lockstep.protocol.description import (
    Action,
    ActionParameter,
    BodyTwist,
    Camera,
    ForceFeeling,
    Microphone,
    RobotDescription,
    WrenchSensor,
)
from lockstep.robot_bridge.robots.mobile_manipulator.controls import AXES, LAYERS
from lockstep.robot_bridge.robots.mobile_manipulator.goal_driven.description import describe_arm
from lockstep.robot_bridge.robots.mobile_manipulator.kinematics import describe_bodies, describe_joints
from lockstep.robot_bridge.robots.mobile_manipulator.limits import BASE_ON_FLOOR, GEOFENCES, arm_limits
from lockstep.robot_bridge.robots.mobile_manipulator.range_ring import RING
from lockstep.robot_bridge.robots.mobile_manipulator.simulation import MOUNT
from lockstep.robot_bridge.robots.mujoco_view.calibration import calibrated

__all__ = ["CAMERAS", "MICROPHONE", "describe", "with_goals"]

CAMERAS: Final = (  # names are those of the model's cameras
    Camera(name="overview", label="Overview", width=640, height=480, frame_rate=30.0),
    Camera(name="wrist", label="Wrist", width=320, height=240, frame_rate=15.0),
)
MICROPHONE: Final = Microphone(name="microphone", label="Microphone", sample_rate=48_000)

WRENCH: Final = WrenchSensor(
    name="contact", body=MOUNT, threshold_force=3.0, full_scale_force=150.0, full_scale_torque=80.0
)

# A push at the wrist is seldom more than a tenth of the sensor's range: it is felt early.
FEELING: Final = ForceFeeling(threshold_newtons=3.0, full_newtons=80.0, curve=0.6)
ACTIONS: Final = (
    Action(name="home", label="Arm home"),
    Action(
        name="light",
        label="Light",
        moves=False,
        parameters=(ActionParameter(name="on", label="On", kind="switch", default=True),),
    ),
)
TOOL_TWIST: Final = BodyTwist(
    body="tool",
    frame=MOUNT,
    point=(0.17, 0.0, 0.0),  # the tip
    linear=("tool.vx", "tool.vy", "tool.vz"),
    angular=("tool.wx", "tool.wy", "tool.wz"),
)


def with_goals(description: RobotDescription) -> RobotDescription:
    """Return the same robot with an arm that is driven by goals."""
    arm = describe_arm(description.joints, description.bodies)
    base = tuple(axis for axis in AXES if axis.name.startswith("base."))
    return msgspec.structs.replace(
        description,
        name="mobile-manipulator-goals",
        label="Mobile manipulator with goals (MuJoCo)",
        axes=(*base, *arm.joints, *arm.axes.all),
        layers=arm.layers,
        body_twists=(),
        position_limits=arm.limits,
        poses=(arm.pose,),
    )


def describe(model: Any) -> RobotDescription:
    """Return the description that belongs to the compiled model."""
    joints, bodies = describe_joints(model), describe_bodies(model)
    return RobotDescription(
        name="mobile-manipulator",
        label="Mobile manipulator (MuJoCo)",
        axes=AXES,
        joints=joints,
        layers=LAYERS,
        cameras=tuple(calibrated(camera, model, bodies) for camera in CAMERAS),
        microphones=(MICROPHONE,),
        wrench=WRENCH,
        ranges=RING,
        force_feeling=FEELING,
        actions=ACTIONS,
        body_twists=(TOOL_TWIST,),
        bodies=bodies,
        position_limits=arm_limits(joints),
        planar_base=BASE_ON_FLOOR,
        geofences=GEOFENCES,
        hold=0.3,
        watchdog=0.25,  # a simulation hurts no person, and busy machines hold it up
        max_event_age=2.0,
        max_event_rate=60.0,
    )
