"""The size that a feedback may have as JSON: no peer takes a message of more than 64 KiB."""

from collections.abc import Iterable

import msgspec

from lockstep.protocol.messages import Feedback

__all__ = ["MAX_FEEDBACK_BYTES", "is_too_large", "most_bytes"]

MAX_FEEDBACK_BYTES = 60 << 10  # as JSON
NUMBER = 25  # bytes of the longest number and its comma
CHARACTER = 6  # bytes of the longest character: an escaped one
QUOTES = 3  # bytes around a text, with its comma
OTHERS = 1024  # bytes of all fields of a fixed size, with all names


def is_too_large(feedback: Feedback) -> bool:
    """Return whether a feedback has more than `MAX_FEEDBACK_BYTES`. Hardly any has to be encoded to find that out."""
    numbers = sum(map(len, (feedback.axes, feedback.joints, feedback.goals, feedback.wrench, feedback.ranges)))
    texts = (feedback.stop.by, feedback.stop.reason, *feedback.faults, *feedback.limits, *feedback.unknown)
    most = OTHERS + most_bytes(numbers, texts)
    return most > MAX_FEEDBACK_BYTES and len(msgspec.json.encode(feedback)) > MAX_FEEDBACK_BYTES


def most_bytes(numbers: int, texts: Iterable[str]) -> int:
    """Return the most bytes that so many numbers, and these texts, have as JSON."""
    lengths = list(map(len, texts))
    return NUMBER * numbers + QUOTES * len(lengths) + CHARACTER * sum(lengths)
