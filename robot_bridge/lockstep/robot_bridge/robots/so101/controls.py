"""The arm's axes, and their bindings to gamepad, touch sticks and keys, in two layers."""

import math
from typing import Final

from lockstep.protocol.description import Axis, Binding, ControlLayer
from lockstep.robot_bridge.robots.stick_bindings import leftwards, upwards

__all__ = ["AXES", "JOINT_AXES", "LAYERS", "POSITION_AXES", "RATES", "ROTATION_AXES"]

STOPS_IN: Final = 0.15  # s from an axis' full speed to a standstill, when it brakes
SPEEDS_UP_IN: Final = 0.25  # s to its full speed
JOINT_REACH: Final = 0.7  # rad: a little more than a leader arm gets ahead
TOOL_REACH: Final = 0.10  # m
HALF_A_TURN: Final = round(math.pi, 5)
RATES: Final[tuple[float, ...]] = (2.0, 1.6, 2.0, 2.5, 3.0, 3.0)  # rad/s, of each joint, always; the servos make 5


def goal(
    name: str, label: str, unit: str, bounds: tuple[float, float], speed: float, reach: float, *, grips: bool = False
) -> Axis:
    return Axis(
        name=name,
        label=label,
        unit=unit,
        kind="goal",
        minimum=bounds[0],
        maximum=bounds[1],
        slew=speed,
        acceleration=round(speed / SPEEDS_UP_IN, 5),
        brake=round(speed / STOPS_IN, 5),
        reach=reach,
        grips=grips,
    )


# The joints' ranges are the model's, rounded inwards. The names are those of LeRobot's SO-101.
JOINT_AXES: Final[tuple[Axis, ...]] = (
    goal("shoulder_pan", "Pan right", "rad", (-1.919, 1.919), 1.5, JOINT_REACH),
    goal("shoulder_lift", "Shoulder forward", "rad", (-1.745, 1.745), 1.2, JOINT_REACH),
    goal("elbow_flex", "Elbow down", "rad", (-1.689, 1.689), 1.5, JOINT_REACH),
    goal("wrist_flex", "Wrist down", "rad", (-1.658, 1.658), 1.8, JOINT_REACH),
    goal("wrist_roll", "Wrist roll", "rad", (-2.743, 2.841), 2.0, JOINT_REACH),
    # A block between the fingertips keeps them from a goal that squeezes it: that goal may be as far as the range.
    goal("gripper", "Gripper open", "rad", (-0.174, 1.745), 2.5, 2.0, grips=True),
)
POSITION_AXES: Final = (
    goal("tool.x", "Tool forward", "m", (-0.40, 0.46), 0.20, TOOL_REACH),
    goal("tool.y", "Tool left", "m", (-0.46, 0.46), 0.20, TOOL_REACH),
    goal("tool.z", "Tool up", "m", (0.005, 0.50), 0.15, TOOL_REACH),
)
# Five joints cannot turn the tool every way at every place: the measured rotation may differ from the goal by any
# angle.
ROTATION_AXES: Final = (
    goal("tool.rx", "Tool roll", "rad", (-HALF_A_TURN, HALF_A_TURN), 1.2, 2 * HALF_A_TURN),
    goal("tool.ry", "Tool pitch down", "rad", (-HALF_A_TURN, HALF_A_TURN), 1.2, 2 * HALF_A_TURN),
    goal("tool.rz", "Tool turn left", "rad", (-HALF_A_TURN, HALF_A_TURN), 1.2, 2 * HALF_A_TURN),
)
AXES: Final = (*JOINT_AXES, *POSITION_AXES, *ROTATION_AXES)


GRIPPER: Final = Binding(axis="gripper", pad="triggers", key_positive="KeyT", key_negative="KeyG")
LAYERS: Final = (
    ControlLayer(
        name="tool",
        label="Tool",
        bindings=(
            upwards("tool.x", "left_y", "left_y", ("KeyW", "KeyS")),
            leftwards("tool.y", "left_x", "left_x", ("KeyA", "KeyD")),
            upwards("tool.z", "right_y", "right_y", ("KeyR", "KeyF")),
            leftwards("tool.rz", "right_x", "right_x", ("KeyQ", "KeyE")),
            # Up lifts the tool's nose, which is negative pitch; right turns it clockwise seen from behind.
            Binding(axis="tool.ry", pad="dpad_y", key_positive="ArrowDown", key_negative="ArrowUp"),
            Binding(axis="tool.rx", pad="dpad_x", key_positive="ArrowRight", key_negative="ArrowLeft"),
            GRIPPER,
        ),
    ),
    ControlLayer(
        name="joints",
        label="Joints",
        bindings=(
            # A positive pan turns to the right: the model's axis points down.
            leftwards("shoulder_pan", "left_x", "left_x", ("KeyD", "KeyA"), reverse=True),
            upwards("shoulder_lift", "left_y", "left_y", ("KeyW", "KeyS")),
            upwards("elbow_flex", "right_y", "right_y", ("KeyF", "KeyR"), reverse=True),
            leftwards("wrist_roll", "right_x", "right_x", ("KeyQ", "KeyE")),
            Binding(axis="wrist_flex", pad="dpad_y", key_positive="ArrowDown", key_negative="ArrowUp"),
            GRIPPER,
        ),
    ),
)
