"""The arm's inverse kinematics: its chain of joints, and what keeps it in its ranges, off itself and off the table."""

import math
from collections.abc import Mapping
from typing import Final

from lockstep.protocol.description import RobotDescription
from lockstep.robot_bridge.kinematics.chain import Chain
from lockstep.robot_bridge.kinematics.clearance import Capsule, Clearance
from lockstep.robot_bridge.kinematics.obstacles import Obstacles, plane
from lockstep.robot_bridge.kinematics.pose_solver import JointBounds, PoseSolver, Tuning
from lockstep.robot_bridge.kinematics.surfaces import body_surfaces
from lockstep.robot_bridge.robots.so101.controls import JOINT_AXES, POSITION_AXES, RATES, ROTATION_AXES
from lockstep.robot_bridge.robots.so101.description import TOOL_BODY
from lockstep.robot_bridge.robots.so101.model import ARM

__all__ = ["CAPSULES", "PAIRS", "arm_chain", "arm_solver"]

# Through the boxes that the links collide with, whose corners stick out by up to 15 mm. The hand's does not hold the
# moving jaw.
CAPSULES: Final[Mapping[str, Capsule]] = {
    "": Capsule((0.012, 0.0, -0.02), (0.012, 0.0, 0.03), 0.048),  # the foot
    "arm.shoulder": Capsule((-0.028, 0.0, -0.040), (-0.028, 0.0, 0.025), 0.036),
    "arm.upper_arm": Capsule((-0.115, -0.008, 0.018), (-0.010, 0.0, 0.018), 0.034),
    "arm.lower_arm": Capsule((-0.125, 0.003, 0.018), (-0.010, 0.0, 0.018), 0.034),
    "arm.wrist": Capsule((0.0, -0.055, 0.0235), (0.0, -0.010, 0.0235), 0.040),
    "arm.gripper": Capsule((-0.003, 0.0, -0.020), (-0.014, 0.0, -0.075), 0.034),
}
PAIRS: Final = (
    ("", "arm.lower_arm"),
    ("", "arm.wrist"),
    ("", "arm.gripper"),
    ("arm.shoulder", "arm.wrist"),
    ("arm.shoulder", "arm.gripper"),
    ("arm.upper_arm", "arm.gripper"),
)

TABLE: Final = plane("the table", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0))

# Faster than its goals together, so that a tool that lags arrives; far slower than its joints could throw it.
TUNING: Final = Tuning(
    safe=0.02,
    close=0.004,
    fastest=1.25 * math.hypot(*(axis.slew for axis in POSITION_AXES)),
    quickest=1.25 * math.hypot(*(axis.slew for axis in ROTATION_AXES)),
)


def arm_chain(description: RobotDescription) -> Chain:
    """Return the chain from the foot to the tool; the foot's frame is the world's."""
    return Chain(description.bodies, TOOL_BODY)


def arm_solver(description: RobotDescription, chain: Chain) -> PoseSolver:
    """Return the solver for the tool's pose."""
    axes = JOINT_AXES[ARM]
    bounds = JointBounds(
        lower=tuple(axis.minimum for axis in axes), upper=tuple(axis.maximum for axis in axes), rates=RATES[ARM]
    )
    table = Obstacles(chain, body_surfaces(description.bodies, chain), (TABLE,))
    keeps_off = (Clearance(chain, CAPSULES, PAIRS), table)
    return PoseSolver(chain, bounds, keeps_off=keeps_off, tuning=TUNING)
