"""The structs and request numbers of Linux' force-feedback interface (linux/input.h, Documentation/input/ff.rst)."""

import ctypes
from ctypes import Structure, Union, c_int16, c_int32, c_uint16, c_uint32, c_ulong, c_void_p
from typing import Final

from lockstep.client.force_feedback.effect_core import Effect, EffectKind

__all__ = [
    "EVIOCGBIT_FF",
    "EVIOCRMFF",
    "EVIOCSFF",
    "EV_FF",
    "FF_BYTES",
    "FF_CODES",
    "FF_GAIN",
    "FfEffect",
    "InputEvent",
]
__all__ += ["encode"]

EV_FF: Final = 0x15
FF_CODES: Final[dict[EffectKind, int]] = {"constant": 0x52, "spring": 0x53, "damper": 0x55}
FF_GAIN: Final = 0x60
FF_BYTES: Final = 16  # 128 bits of FF_… codes
LONGEST_MS: Final = 0x7FFF


class _Trigger(Structure):
    _fields_ = (("button", c_uint16), ("interval", c_uint16))


class _Replay(Structure):
    _fields_ = (("length", c_uint16), ("delay", c_uint16))  # ms; a length of 0 would be for ever


class _Envelope(Structure):
    _fields_ = tuple((name, c_uint16) for name in ("attack_length", "attack_level", "fade_length", "fade_level"))


class _Constant(Structure):
    _fields_ = (("level", c_int16), ("envelope", _Envelope))


class _Condition(Structure):
    _fields_ = (
        ("right_saturation", c_uint16),
        ("left_saturation", c_uint16),
        ("right_coeff", c_int16),
        ("left_coeff", c_int16),
        ("deadband", c_uint16),
        ("center", c_int16),
    )


class _Periodic(Structure):  # not played; it is the union's largest member
    _fields_ = (
        ("waveform", c_uint16),
        ("period", c_uint16),
        ("magnitude", c_int16),
        ("offset", c_int16),
        ("phase", c_uint16),
        ("envelope", _Envelope),
        ("custom_len", c_uint32),
        ("custom_data", c_void_p),
    )


class _Parameters(Union):
    _fields_ = (("constant", _Constant), ("condition", _Condition * 2), ("periodic", _Periodic))


class FfEffect(Structure):
    """struct ff_effect. `id` -1 asks for a new effect; the kernel writes the id that it gave."""

    _fields_ = (
        ("type", c_uint16),
        ("id", c_int16),
        ("direction", c_uint16),
        ("trigger", _Trigger),
        ("replay", _Replay),
        ("u", _Parameters),
    )


class InputEvent(Structure):
    """struct input_event."""

    _fields_ = (("sec", c_ulong), ("usec", c_ulong), ("type", c_uint16), ("code", c_uint16), ("value", c_int32))


# _IOC of asm-generic/ioctl.h, which x86, ARM and RISC-V use: direction, size, type, number.
def _request(direction: int, number: int, size: int) -> int:
    return direction << 30 | size << 16 | ord("E") << 8 | number


EVIOCSFF: Final = _request(1, 0x80, ctypes.sizeof(FfEffect))
EVIOCRMFF: Final = _request(1, 0x81, ctypes.sizeof(ctypes.c_int))
EVIOCGBIT_FF: Final = _request(2, 0x20 + EV_FF, FF_BYTES)


def encode(effect: Effect, identifier: int) -> FfEffect:
    """Return the struct for an effect; `identifier` -1 for a new one."""
    made = FfEffect(type=FF_CODES[effect.kind], id=identifier)
    made.replay.length = max(1, min(LONGEST_MS, int(effect.seconds * 1000)))
    share = max(0.0, min(1.0, effect.share))
    if effect.kind == "constant":
        made.direction = int(effect.degrees % 360 / 360 * 0x10000) & 0xFFFF
        made.u.constant.level = round(share * 0x7FFF)
    else:
        for axis in made.u.condition:
            axis.right_saturation = axis.left_saturation = round(share * 0xFFFF)
            axis.right_coeff = axis.left_coeff = round(share * 0x7FFF)
    return made
