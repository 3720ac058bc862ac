"""Backoff between tries: doubling up to a cap, with jitter. No I/O."""

import random

__all__ = ["Backoff"]


class Backoff:
    """Computes the waits. Call `next` before every try after the first, `healthy` when it has worked for a while."""

    def __init__(self, first: float, cap: float, jitter: random.Random | None = None) -> None:
        self._first = first
        self._cap = cap
        self._tries = 0
        self._jitter = jitter or random.Random()

    def next(self) -> float:
        """Return seconds: between half and all of the doubled wait, so that many clients do not come at once."""
        full = min(self._cap, self._first * 2.0 ** min(self._tries, 30))
        self._tries += 1
        return full * self._jitter.uniform(0.5, 1)

    def healthy(self) -> None:
        self._tries = 0
