"""The robot's axes, and their bindings to gamepad, touch sticks and keys, in two layers."""

from typing import Final

from lockstep.protocol.description import Axis, Binding, ControlLayer, PadInput, TouchPad

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


def forward(name: str, stick: PadInput, touch: TouchPad, keys: tuple[str, str]) -> Binding:
    """Bind an axis so that stick up is positive; pads give that as a negative number, touch sticks as a positive."""
    return Binding(
        axis=name, pad=stick, touch=touch, invert_pad=True, key_positive=f"Key{keys[0]}", key_negative=f"Key{keys[1]}"
    )


def leftward(name: str, stick: PadInput, touch: TouchPad, keys: tuple[str, str]) -> Binding:
    """Bind an axis so that stick left is positive, which both kinds of stick give as a negative number."""
    return Binding(
        axis=name,
        pad=stick,
        touch=touch,
        invert_pad=True,
        invert_touch=True,
        key_positive=f"Key{keys[0]}",
        key_negative=f"Key{keys[1]}",
    )


LAYERS: Final = (
    ControlLayer(
        name="drive",
        label="Drive",
        bindings=(
            forward("base.vx", "left_y", "left_y", ("W", "S")),
            leftward("base.vy", "left_x", "left_x", ("A", "D")),
            leftward("base.wz", "right_x", "right_x", ("Q", "E")),
            forward("tool.vz", "right_y", "right_y", ("R", "F")),
            Binding(axis="tool.vx", pad="triggers", key_positive="ArrowUp", key_negative="ArrowDown"),
            Binding(axis="tool.vy", pad="dpad_x", invert_pad=True, key_positive="ArrowLeft", key_negative="ArrowRight"),
        ),
    ),
    ControlLayer(
        name="arm",
        label="Tool",
        bindings=(
            forward("tool.vx", "left_y", "left_y", ("W", "S")),
            leftward("tool.vy", "left_x", "left_x", ("A", "D")),
            leftward("tool.wz", "right_x", "right_x", ("Q", "E")),
            forward("tool.vz", "right_y", "right_y", ("R", "F")),
            # Up lifts the tool's nose, which is negative pitch; right turns it clockwise seen from behind.
            Binding(axis="tool.wy", pad="dpad_y", key_positive="ArrowDown", key_negative="ArrowUp"),
            Binding(axis="tool.wx", pad="dpad_x", key_positive="ArrowRight", key_negative="ArrowLeft"),
            Binding(axis="base.vx", pad="triggers", key_positive="KeyT", key_negative="KeyG", scale=0.5),
        ),
    ),
)
