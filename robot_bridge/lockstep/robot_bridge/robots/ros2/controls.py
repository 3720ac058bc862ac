"""Assigns sticks and keys to the axes, unless the settings do so themselves."""

from collections.abc import Sequence
from typing import Final, NamedTuple

from lockstep.protocol.description import Axis, Binding, ControlLayer, PadInput, TouchPad

__all__ = ["arm_layers", "base_layer"]


class _Stick(NamedTuple):
    pad: PadInput
    touch: TouchPad
    inverted_touch: bool  # for sticks whose left is positive
    keys: tuple[str, str]


# Pads report up and left as negative numbers; up, forward and left are positive here (ROS REP 103).
_STICKS: Final = (
    _Stick("left_y", "left_y", False, ("KeyW", "KeyS")),
    _Stick("left_x", "left_x", True, ("KeyA", "KeyD")),
    _Stick("right_y", "right_y", False, ("KeyR", "KeyF")),
    _Stick("right_x", "right_x", True, ("KeyQ", "KeyE")),
)
_FORWARD, _LEFT, _UP, _TURN = _STICKS


def base_layer(forward: str, left: str | None, turn: str | None) -> ControlLayer:
    """Return a layer with forward and sideways on the left stick, turning on the right one."""
    bindings = [_binding(forward, _FORWARD)]
    if left is not None:
        bindings.append(_binding(left, _LEFT))
    if turn is not None:
        keys = _LEFT.keys if left is None else _TURN.keys
        bindings.append(_binding(turn, _TURN._replace(keys=keys)))
    return ControlLayer(name="drive", label="Drive", bindings=tuple(bindings))


def arm_layers(axes: Sequence[Axis]) -> tuple[ControlLayer, ...]:
    """Return layers of four joints each, so that two touch sticks reach all of them."""
    groups = [axes[start : start + len(_STICKS)] for start in range(0, len(axes), len(_STICKS))]
    return tuple(
        ControlLayer(
            name=f"arm{number + 1}",
            label="Arm" if len(groups) == 1 else f"Arm {number + 1}",
            bindings=tuple(_binding(axis.name, stick) for axis, stick in zip(group, _STICKS, strict=False)),
        )
        for number, group in enumerate(groups)
    )


def _binding(axis: str, stick: _Stick) -> Binding:
    return Binding(
        axis=axis,
        pad=stick.pad,
        touch=stick.touch,
        invert_pad=True,
        invert_touch=stick.inverted_touch,
        key_positive=stick.keys[0],
        key_negative=stick.keys[1],
    )
