"""Makes a feedback as small as peers take it. No I/O."""

from collections.abc import Sequence
from typing import NamedTuple

import msgspec

from lockstep.protocol.feedback_size import MAX_FEEDBACK_BYTES, most_bytes
from lockstep.protocol.messages import MAX_FAULTS, MAX_LIMITS
from lockstep.robot_bridge.robots.base import Measurement

__all__ = ["Texts", "within_size"]

MAX_FAULT = 500  # characters in one fault
OTHERS = 8 << 10  # bytes that are kept for the words of a stop and for all fields of a fixed size
DECIMALS = 4  # of a distance in m, where there is no room for all its digits


class Texts(NamedTuple):
    """The texts of a feedback, and how many of them found no room in it."""

    faults: list[str]
    unknown: list[str]
    limits: list[str]
    left_out: int


def within_size(
    measured: Measurement, goals: Sequence[float | None], unknown: Sequence[str], limits: Sequence[str]
) -> tuple[list[float], Texts]:
    """Return the ranges and the texts that a feedback of at most `MAX_FEEDBACK_BYTES` has of these.

    The newest faults come first, then the names of what could not be measured, then those of limits.
    """
    faults = [_text(fault[:MAX_FAULT]) for fault in measured.faults[-MAX_FAULTS:]]
    room = MAX_FEEDBACK_BYTES - OTHERS
    numbers = (measured.axes, measured.joints, goals, measured.wrench, measured.ranges)
    fits = len(unknown) <= MAX_LIMITS and len(limits) <= MAX_LIMITS
    if fits and most_bytes(sum(map(len, numbers)), (*faults, *unknown, *limits)) <= room:
        return measured.ranges, Texts(faults, list(unknown), list(limits), 0)
    ranges = measured.ranges
    room -= sum(map(_json_bytes, numbers))
    if room < 0:
        rounded = [round(distance, DECIMALS) for distance in ranges]
        room += _json_bytes(ranges) - _json_bytes(rounded)
        ranges = rounded
    kept: list[list[str]] = []
    for texts, most in ((faults[::-1], MAX_FAULTS), (unknown, MAX_LIMITS), (limits, MAX_LIMITS)):
        kept.append([])
        for text in texts:
            size = _json_bytes(text)
            if size <= room and len(kept[-1]) < most:
                room -= size
                kept[-1].append(text)
    newest, not_measured, acting = kept
    left_out = len(faults) + len(unknown) + len(limits) - sum(map(len, kept))
    return ranges, Texts(newest[::-1], not_measured, acting, left_out)


def _text(words: str) -> str:
    """Return words that can be encoded: those of an operating system may hold bytes that are no text."""
    return words if words.isascii() else words.encode(errors="replace").decode()


def _json_bytes(value: Sequence[float | None] | str) -> int:
    """Return the bytes of a value as JSON, with a comma behind it."""
    return len(msgspec.json.encode(value)) + 1
