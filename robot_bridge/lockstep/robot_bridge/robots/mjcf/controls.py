"""Assigns sticks, keys and buttons to the axes of a model.

Each layer has four axes on the two sticks, which pads, keys and touch screens all have. Further inputs of a pad and of
the keys go to the axes of the following layers, so that seven axes need no change of layer with them.
"""

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from lockstep.protocol.description import Axis, Binding, ControlLayer, PadInput, TouchPad
from lockstep.robot_bridge.robots.mjcf.actuators import Actuator

__all__ = ["layers_of"]


class Stick(NamedTuple):
    name: TouchPad
    keys: tuple[str, str]  # positive, negative
    is_sideways: bool  # left is positive


STICKS: Final = {
    "left_y": Stick("left_y", ("KeyW", "KeyS"), False),
    "left_x": Stick("left_x", ("KeyA", "KeyD"), True),
    "right_y": Stick("right_y", ("KeyR", "KeyF"), False),
    "right_x": Stick("right_x", ("KeyQ", "KeyE"), True),
}
MORE: Final[tuple[tuple[PadInput, tuple[str, str], bool], ...]] = (
    ("triggers", ("ArrowUp", "ArrowDown"), False),
    ("dpad_x", ("ArrowLeft", "ArrowRight"), True),
    ("dpad_y", ("KeyT", "KeyG"), True),
)
# The sticks that suit a joint along or about x, y or z (as the model begins), the best first.
SLIDES: Final = (("left_y", "right_y"), ("left_x", "right_x"), ("right_y", "left_y"))
TURNS: Final = (("right_x", "left_x"), ("left_y", "right_y"), ("left_x", "right_x"))
ANY: Final = ("left_y", "left_x", "right_y", "right_x")
MOST_LAYERS: Final = 12


def layers_of(model: Any, data: Any, axes: Sequence[Axis], actuators: Sequence[Actuator]) -> tuple[ControlLayer, ...]:
    """Return the layers for axes and the actuators that belong to them, in the same order.

    `data` is in the model's first posture.
    """
    wishes = [_wishes(data, each) for each in actuators]
    groups = [range(first, min(first + len(STICKS), len(axes))) for first in range(0, len(axes), len(STICKS))]
    return tuple(
        ControlLayer(
            name=f"layer{number + 1}",
            label="Drive" if len(groups) == 1 else _label(axes, group),
            bindings=(*_on_sticks(axes, group, wishes), *_besides(axes, group)),
        )
        for number, group in enumerate(groups[:MOST_LAYERS])
    )


def _label(axes: Sequence[Axis], group: range) -> str:
    """Return a label with the numbers of the first and last axis, which the axis bars show beside the names."""
    first, last = group.start + 1, group.stop
    return axes[group.start].label if first == last else f"Axes {first}–{last}"


def _wishes(data: Any, actuator: Actuator) -> tuple[str, ...]:
    if actuator.joint is None:
        return ANY
    direction = int(np.abs(data.xaxis[actuator.joint]).argmax())
    return (*(TURNS if actuator.is_rotary else SLIDES)[direction], *ANY)


def _on_sticks(axes: Sequence[Axis], group: range, wishes: Sequence[tuple[str, ...]]) -> list[Binding]:
    free = dict(STICKS)
    found = []
    for number in group:
        stick = free.pop(next(wish for wish in wishes[number] if wish in free))
        found.append(
            Binding(
                axis=axes[number].name,
                pad=stick.name,
                touch=stick.name,
                invert_pad=True,  # W3C: up and left are negative
                invert_touch=stick.is_sideways,
                key_positive=stick.keys[0],
                key_negative=stick.keys[1],
            )
        )
    return found


def _besides(axes: Sequence[Axis], group: range) -> list[Binding]:
    others = [(group.stop + step) % len(axes) for step in range(max(0, len(axes) - len(group)))]
    return [
        Binding(axis=axes[number].name, pad=pad, invert_pad=invert, key_positive=keys[0], key_negative=keys[1])
        for number, (pad, keys, invert) in zip(others, MORE, strict=False)
    ]
