"""A broken promise."""

import msgspec

__all__ = ["Violation"]


class Violation(msgspec.Struct, frozen=True):
    event: int
    time: int  # µs since 1970, arrival
    text: str
