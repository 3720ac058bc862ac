"""The robot's axes, and their bindings to gamepad, touch sticks and keys, in two layers."""

from typing import Final

from lockstep.protocol.description import Axis, Binding, ControlLayer
from lockstep.robot_bridge.robots.stick_bindings import leftwards, upwards

__all__ = ["AXES", "LAYERS"]

SLEW_TIME: Final = 0.25  # s from rest to full speed
BRAKE_TIME: Final = 0.08  # s from full speed to rest


def axis(name: str, label: str, unit: str, fastest: float) -> Axis:
    return Axis(
        name=name,
        label=label,
        unit=unit,
        minimum=-fastest,
        maximum=fastest,
        slew=round(fastest / SLEW_TIME, 5),
        brake=round(fastest / BRAKE_TIME, 5),
    )


AXES: Final = (
    axis("base.vx", "Forward", "m/s", 0.6),
    axis("base.vy", "Left", "m/s", 0.5),
    axis("base.wz", "Turn left", "rad/s", 1.2),
    axis("tool.vx", "Tool forward", "m/s", 0.25),
    axis("tool.vy", "Tool left", "m/s", 0.25),
    axis("tool.vz", "Tool up", "m/s", 0.25),
    axis("tool.wx", "Tool roll", "rad/s", 1.0),
    axis("tool.wy", "Tool pitch down", "rad/s", 1.0),
    axis("tool.wz", "Tool turn left", "rad/s", 1.0),
)


LAYERS: Final = (
    ControlLayer(
        name="drive",
        label="Drive",
        bindings=(
            upwards("base.vx", "left_y", "left_y", ("KeyW", "KeyS")),
            leftwards("base.vy", "left_x", "left_x", ("KeyA", "KeyD")),
            leftwards("base.wz", "right_x", "right_x", ("KeyQ", "KeyE")),
            upwards("tool.vz", "right_y", "right_y", ("KeyR", "KeyF")),
            Binding(axis="tool.vx", pad="triggers", key_positive="ArrowUp", key_negative="ArrowDown"),
            Binding(axis="tool.vy", pad="dpad_x", invert_pad=True, key_positive="ArrowLeft", key_negative="ArrowRight"),
        ),
    ),
    ControlLayer(
        name="arm",
        label="Tool",
        bindings=(
            upwards("tool.vx", "left_y", "left_y", ("KeyW", "KeyS")),
            leftwards("tool.vy", "left_x", "left_x", ("KeyA", "KeyD")),
            leftwards("tool.wz", "right_x", "right_x", ("KeyQ", "KeyE")),
            upwards("tool.vz", "right_y", "right_y", ("KeyR", "KeyF")),
            # Up lifts the tool's nose, which is negative pitch; right turns it clockwise seen from behind.
            Binding(axis="tool.wy", pad="dpad_y", key_positive="ArrowDown", key_negative="ArrowUp"),
            Binding(axis="tool.wx", pad="dpad_x", key_positive="ArrowRight", key_negative="ArrowLeft"),
            Binding(axis="base.vx", pad="triggers", key_positive="KeyT", key_negative="KeyG", scale=0.5),
        ),
    ),
)
