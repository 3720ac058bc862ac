"""Bindings of an axis to a stick and two keys, with the signs that pads and touch sticks give."""

from lockstep.protocol.description import Binding, PadInput, TouchPad

__all__ = ["leftwards", "upwards"]


def upwards(
    axis: str,
    stick: PadInput,
    touch: TouchPad | None,
    keys: tuple[str, str],
    *,
    scale: float = 1.0,
    reverse: bool = False,
) -> Binding:
    """Bind an axis so that stick up is positive; pads give that as a negative number, touch sticks as a positive.

    Args:
        keys: for the positive and the negative direction
        reverse: stick down is positive
    """
    return Binding(
        axis=axis,
        pad=stick,
        touch=touch,
        invert_pad=not reverse,
        invert_touch=reverse,
        key_positive=keys[0],
        key_negative=keys[1],
        scale=scale,
    )


def leftwards(
    axis: str,
    stick: PadInput,
    touch: TouchPad | None,
    keys: tuple[str, str],
    *,
    scale: float = 1.0,
    reverse: bool = False,
) -> Binding:
    """Bind an axis so that stick left is positive, which both kinds of stick give as a negative number.

    Args:
        keys: for the positive and the negative direction
        reverse: stick right is positive
    """
    return Binding(
        axis=axis,
        pad=stick,
        touch=touch,
        invert_pad=not reverse,
        invert_touch=not reverse,
        key_positive=keys[0],
        key_negative=keys[1],
        scale=scale,
    )
