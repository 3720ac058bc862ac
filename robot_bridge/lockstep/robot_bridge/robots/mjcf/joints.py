"""The joints of a model as the robot link describes them: one number each.

A joint that is free in space becomes six of them (x, y, z, yaw, pitch, roll) and a ball joint three, so that everything
that moves can be posed.
"""

import math
from collections.abc import Iterator, Sequence
from typing import Any, Final, NamedTuple

import mujoco

from lockstep.protocol.description import BodyJoint, Joint
from lockstep.robot_bridge.robots.mjcf.names import name_of

__all__ = ["ModelJoint", "joints_of"]

FREE: Final = int(mujoco.mjtJoint.mjJNT_FREE)
BALL: Final = int(mujoco.mjtJoint.mjJNT_BALL)
SLIDE: Final = int(mujoco.mjtJoint.mjJNT_SLIDE)
MOST_FREE: Final = 12  # free and ball joints; further ones are not described
PLACES: Final = (("x", (1.0, 0.0, 0.0)), ("y", (0.0, 1.0, 0.0)), ("z", (0.0, 0.0, 1.0)))
ANGLES: Final = (("yaw", (0.0, 0.0, 1.0)), ("pitch", (0.0, 1.0, 0.0)), ("roll", (1.0, 0.0, 0.0)))


class ModelJoint(NamedTuple):
    """A joint of the model, and the described joints that stand for it."""

    number: int
    parts: tuple[Joint, ...]
    moves: tuple[BodyJoint, ...]  # motions of the body by the parts
    qpos: int  # index of its first value in qpos
    is_free: bool  # its position is in the world, not in its parent
    is_ball: bool

    def values(self, qpos: Any) -> Iterator[float]:
        """Yield the value of each part."""
        first = self.qpos
        if self.is_free:
            yield from map(float, qpos[first : first + 3])
            yield from _angles(qpos[first + 3 : first + 7])
        elif self.is_ball:
            yield from _angles(qpos[first : first + 4])
        else:
            yield float(qpos[first])


def joints_of(model: Any) -> list[ModelJoint]:
    """Return the joints that are described, in the model's order."""
    found, loose = [], 0
    for number in range(model.njnt):
        kind = int(model.jnt_type[number])
        loose += kind in (FREE, BALL)
        if kind not in (FREE, BALL) or loose <= MOST_FREE:
            found.append(_joint(model, number, kind))
    return found


def _joint(model: Any, number: int, kind: int) -> ModelJoint:
    name = name_of(model, "joint", number)
    if kind in (FREE, BALL):
        owner = name_of(model, "body", int(model.jnt_bodyid[number]))
        base = name if model.joint(number).name else owner
        places = [(f"{base}.{word}", "m", axis) for word, axis in PLACES] if kind == FREE else []
        parts = [*places, *((f"{base}.{word}", "rad", axis) for word, axis in ANGLES)]
        return ModelJoint(
            number,
            tuple(Joint(name=part, unit="m" if unit == "m" else "rad") for part, unit, _ in parts),
            tuple(_move(part, unit == "m", axis) for part, unit, axis in parts),
            int(model.jnt_qposadr[number]),
            kind == FREE,
            kind == BALL,
        )
    low, high = (float(bound) for bound in model.jnt_range[number]) if model.jnt_limited[number] else (None, None)
    is_slide = kind == SLIDE
    return ModelJoint(
        number,
        (Joint(name=name, unit="m" if is_slide else "rad", minimum=low, maximum=high),),
        (_move(name, is_slide, [float(part) for part in model.jnt_axis[number]]),),
        int(model.jnt_qposadr[number]),
        False,
        False,
    )


def _move(joint: str, is_slide: bool, axis: Sequence[float]) -> BodyJoint:
    x, y, z = axis
    return BodyJoint(joint=joint, kind="prismatic" if is_slide else "revolute", axis=(x, y, z))


def _angles(quaternion: Any) -> tuple[float, float, float]:
    """Return yaw, pitch and roll, which turn one after the other, each about the axes as the one before left them."""
    w, x, y, z = (float(part) for part in quaternion)
    length = math.sqrt(w * w + x * x + y * y + z * z) or 1.0
    w, x, y, z = w / length, x / length, y / length, z / length
    pitch = math.asin(min(max(2 * (w * y - z * x), -1.0), 1.0))
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    return yaw, pitch, roll
