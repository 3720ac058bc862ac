"""Reads the description's bodies and joints from the compiled model, so that both agree."""

from typing import Any, Final

from lockstep.protocol.description import Body, Joint
from lockstep.robot_bridge.robots.mobile_manipulator.simulation import JOINTS
from lockstep.robot_bridge.robots.mujoco_bodies import SLIDE, describe_body, rounded

__all__ = ["describe_bodies", "describe_joints"]

DRAWN_GROUPS: Final = (1, 4)
STATIC_BODIES: Final = ("room", "table")
DIGITS: Final = 5


def describe_joints(model: Any) -> tuple[Joint, ...]:
    """Return the robot's joints in the order of the measurement."""
    return tuple(describe_joint(model, index) for index in range(JOINTS))


def describe_bodies(model: Any) -> tuple[Body, ...]:
    """Return the room's fixed bodies, then the robot's from the base to the tool, parents first.

    Movable objects are left out: feedback does not say where they are.
    """
    robot = model.body("base").id
    static = [model.body(name).id for name in STATIC_BODIES]
    moving = [index for index in range(model.nbody) if model.body_rootid[index] == robot]
    return tuple(describe_body(model, index, DRAWN_GROUPS, DIGITS) for index in (*static, *moving))


def describe_joint(model: Any, index: int) -> Joint:
    lower, upper = rounded(model.jnt_range[index], DIGITS) if model.jnt_limited[index] else (None, None)
    unit = "m" if model.jnt_type[index] == SLIDE else "rad"
    return Joint(name=model.joint(index).name, unit=unit, minimum=lower, maximum=upper)  # type: ignore[arg-type]
