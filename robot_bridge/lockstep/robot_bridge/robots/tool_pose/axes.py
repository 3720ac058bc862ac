"""The axes of a tool's pose, for an arm of any size, and their bindings to gamepad, touch sticks and keys."""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

from lockstep.protocol.description import Axis, Binding, ControlLayer
from lockstep.robot_bridge.robots.so101.arm_drive import SETTLES
from lockstep.robot_bridge.robots.stick_bindings import leftwards, upwards

__all__ = ["AXIS_WORDS", "HALF_A_TURN", "ToolAxes", "picture_layer", "shortest_hold", "tool_axes", "tool_layer"]

AXIS_WORDS: Final = (
    ("x", "forward"),
    ("y", "left"),
    ("z", "up"),
    ("rx", "roll"),
    ("ry", "pitch down"),
    ("rz", "turn left"),
)
PICTURE_WORDS: Final = (  # in a camera's frame: x right and y down in its picture, z into it
    ("x", "right"),
    ("y", "down"),
    ("z", "away"),
    ("rx", "pitch up"),
    ("ry", "yaw right"),
    ("rz", "roll clockwise"),
)
HALF_A_TURN: Final = round(math.pi, 5)
STOPS_IN: Final = 0.15  # s from an axis' full speed to a standstill, when it brakes
SPEEDS_UP_IN: Final = 0.25  # s to its full speed
FASTEST: Final = 0.25  # m/s along an axis: the reduced speed of ISO 10218-1
SHARE_OF_LENGTH: Final = 0.4  # of the arm's length in a second, at most
TURNS: Final = 1.2  # rad/s
REACH: Final = 0.2  # of the arm's length that a goal may be ahead of the tool on an axis
LONGEST_REACH: Final = 0.15  # m
# A rotation vector goes on past half a turn, so that a tool whose zero is turned away from where it works has no end
# there. Its own measured rotation is at most half a turn long.
WIDEST_TURN: Final = round(1.5 * math.pi, 5)
DIGITS: Final = 5


class ToolAxes(NamedTuple):
    position: tuple[Axis, ...]  # x, y, z, m
    rotation: tuple[Axis, ...]  # rotation vector, rad

    @property
    def all(self) -> tuple[Axis, ...]:
        return (*self.position, *self.rotation)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(axis.name for axis in self.all)


def shortest_hold() -> float:
    """Return the shortest `hold` (s) that braking the axes and settling fit in."""
    return STOPS_IN + SETTLES


def tool_axes(
    name: str,
    label: str,
    begins: Sequence[float],
    length: float,
    fastest: float | None = None,
    *,
    in_picture: bool = False,
) -> ToolAxes:
    """Return the six axes of a tool.

    Args:
        begins: m, where the arm begins in the pose's frame
        length: m, of the arm; no tool gets further than that from there
        fastest: m/s along an axis; None: by the arm's length
        in_picture: the frame is a camera's
    """
    words = PICTURE_WORDS if in_picture else AXIS_WORDS
    speed = min(SHARE_OF_LENGTH * length, FASTEST) if fastest is None else fastest
    reach = min(REACH * length, LONGEST_REACH)
    position = tuple(
        _axis(f"{name}.{word}", f"{label} {text}", "m", (middle - length, middle + length), speed, reach)
        for (word, text), middle in zip(words[:3], begins, strict=True)
    )
    # An arm of few joints cannot turn its tool every way at every place, so that the measured rotation may differ from
    # the goal by any angle.
    rotation = tuple(
        _axis(f"{name}.{word}", f"{label} {text}", "rad", (-WIDEST_TURN, WIDEST_TURN), TURNS, WIDEST_TURN + HALF_A_TURN)
        for word, text in words[3:]
    )
    return ToolAxes(position, rotation)


def _axis(name: str, label: str, unit: str, bounds: tuple[float, float], speed: float, reach: float) -> Axis:
    return Axis(
        name=name,
        label=label,
        unit=unit,
        kind="goal",
        minimum=round(bounds[0], DIGITS),
        maximum=round(bounds[1], DIGITS),
        slew=round(speed, DIGITS),
        acceleration=round(speed / SPEEDS_UP_IN, DIGITS),
        brake=round(speed / STOPS_IN, DIGITS),
        reach=round(reach + 10**-DIGITS, DIGITS),
    )


def tool_layer(name: str, label: str, axes: Sequence[str], *others: Binding) -> ControlLayer:
    """Return a layer for the six axes of a tool, and other bindings that go with it."""
    x, y, z, rx, ry, rz = axes
    return ControlLayer(
        name=name,
        label=label,
        bindings=(
            upwards(x, "left_y", "left_y", ("KeyW", "KeyS")),
            leftwards(y, "left_x", "left_x", ("KeyA", "KeyD")),
            upwards(z, "right_y", "right_y", ("KeyR", "KeyF")),
            leftwards(rz, "right_x", "right_x", ("KeyQ", "KeyE")),
            # Up lifts the tool's nose, which is negative pitch; right turns it clockwise seen from behind.
            Binding(axis=ry, pad="dpad_y", key_positive="ArrowDown", key_negative="ArrowUp"),
            Binding(axis=rx, pad="dpad_x", key_positive="ArrowRight", key_negative="ArrowLeft"),
            *others,
        ),
    )


def picture_layer(name: str, label: str, axes: Sequence[str], *others: Binding) -> ControlLayer:
    """Return a layer for the six axes of a tool in a camera's frame: left and right stick move it as seen there."""
    x, y, z, rx, ry, rz = axes
    return ControlLayer(
        name=name,
        label=label,
        bindings=(
            upwards(y, "left_y", "left_y", ("KeyS", "KeyW"), reverse=True),
            leftwards(x, "left_x", "left_x", ("KeyD", "KeyA"), reverse=True),
            upwards(z, "right_y", "right_y", ("KeyR", "KeyF")),
            leftwards(rz, "right_x", "right_x", ("KeyE", "KeyQ"), reverse=True),
            Binding(axis=rx, pad="dpad_y", invert_pad=True, key_positive="ArrowUp", key_negative="ArrowDown"),
            Binding(axis=ry, pad="dpad_x", key_positive="ArrowRight", key_negative="ArrowLeft"),
            *others,
        ),
    )
