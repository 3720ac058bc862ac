"""Arms for the tests: of a description's bodies alone, as those behind ROS 2 have them."""

import math
from typing import Final

from lockstep.protocol.description import Body, BodyJoint
from lockstep.robot_bridge.kinematics.chain import Chain
from lockstep.robot_bridge.kinematics.clearance import Capsule, Clearance
from lockstep.robot_bridge.kinematics.pose_solver import JointBounds

__all__ = ["BOUNDS", "DESK_ARM", "LIFT", "POINT", "clearance", "desk_arm", "revolute", "slide"]

POINT: Final = (0.16, 0.0, 0.0)  # m, of the tool's tip in the hand


def revolute(name: str, axis: tuple[float, float, float]) -> BodyJoint:
    return BodyJoint(joint=name, kind="revolute", axis=axis)


def slide(name: str, axis: tuple[float, float, float]) -> BodyJoint:
    return BodyJoint(joint=name, kind="prismatic", axis=axis)


# Five joints in the order of the small arms that people have: pan, lift, elbow, wrist, roll.
DESK_ARM: Final = (
    Body(name="foot", parent=""),
    Body(name="column", parent="foot", position=(0.03, 0.0, 0.1), joints=(revolute("pan", (0.0, 0.0, 1.0)),)),
    Body(name="upper", parent="column", position=(0.03, 0.0, 0.02), joints=(revolute("lift", (0.0, 1.0, 0.0)),)),
    Body(name="fore", parent="upper", position=(0.03, 0.0, 0.115), joints=(revolute("elbow", (0.0, 1.0, 0.0)),)),
    Body(name="wrist", parent="fore", position=(0.135, 0.0, 0.0), joints=(revolute("flex", (0.0, 1.0, 0.0)),)),
    Body(name="hand", parent="wrist", joints=(revolute("roll", (1.0, 0.0, 0.0)),)),
)
# A lift that carries a turned arm of two joints.
LIFT: Final = (
    Body(
        name="carriage",
        parent="",
        orientation=(math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)),
        joints=(slide("z", (0, 0, 2)),),
    ),
    Body(
        name="arm",
        parent="carriage",
        position=(0.2, 0.0, 0.0),
        joints=(revolute("turn", (0, 0, 1)), slide("out", (1, 0, 0))),
    ),
    Body(name="tool", parent="arm", position=(0.1, 0.0, 0.0)),
)
BOUNDS: Final = JointBounds(
    lower=(-1.9, -1.7, -1.6, -1.6, -2.7), upper=(1.9, 1.7, 1.6, 1.6, 2.7), rates=(2.0, 1.6, 2.0, 2.5, 3.0)
)


def desk_arm() -> Chain:
    return Chain(DESK_ARM, "hand", point=POINT)


def clearance(chain: Chain) -> Clearance:
    capsules = {
        "foot": Capsule((0.0, 0.0, 0.0), (0.0, 0.0, 0.06), 0.045),
        "upper": Capsule((0.01, 0.0, 0.03), (0.02, 0.0, 0.09), 0.025),
        "hand": Capsule((0.05, 0.0, 0.0), (0.14, 0.0, 0.0), 0.025),
    }
    return Clearance(chain, capsules, (("foot", "hand"), ("upper", "hand")))
