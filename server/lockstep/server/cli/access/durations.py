"""Parses and formats durations as people write them: "8h", "30m", "1d12h"."""

import re

__all__ = ["duration_words", "parse_duration"]

UNITS = {"s": 1, "m": 60, "h": 3600, "d": 24 * 3600, "w": 7 * 24 * 3600}
PART = re.compile(r"([0-9]{1,6})([smhdw])")


def parse_duration(text: str) -> float:
    """Return the seconds of a duration.

    Raises:
        ValueError: not numbers followed by s, m, h, d or w.
    """
    parts = PART.findall(text)
    if not parts or "".join(number + unit for number, unit in parts) != text:
        raise ValueError(f"{text!r} is not a time such as 30m, 8h or 2d")
    return float(sum(int(number) * UNITS[unit] for number, unit in parts))


def duration_words(seconds: float) -> str:
    """Return the two largest units: "7h 59m"."""
    left, words = max(0, round(seconds)), []
    for unit in ("d", "h", "m", "s"):
        count, left = divmod(left, UNITS[unit])
        if count:
            words.append(f"{count}{unit}")
    return " ".join(words[:2]) or "0s"
