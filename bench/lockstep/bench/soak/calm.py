"""How long everything has been in order."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

__all__ = ["Calm"]


class Calm:
    """The time since the last trouble ended."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._troubles = 0
        self._since = clock()

    @contextmanager
    def trouble(self) -> Iterator[None]:
        """Something is out of order meanwhile."""
        self._troubles += 1
        try:
            yield
        finally:
            self._troubles -= 1
            self._since = self._clock()

    def seconds(self) -> float:
        """Return the seconds for which everything has been in order; 0 while something is not."""
        return 0.0 if self._troubles else self._clock() - self._since
