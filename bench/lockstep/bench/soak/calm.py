"""How long everything has been in order."""

import time
from collections.abc import Iterator
from contextlib import contextmanager

__all__ = ["Calm"]


class Calm:
    """The time since the last trouble ended."""

    def __init__(self) -> None:
        self._troubles = 0
        self._since = time.monotonic()

    @contextmanager
    def trouble(self) -> Iterator[None]:
        """Something is out of order meanwhile."""
        self._troubles += 1
        try:
            yield
        finally:
            self._troubles -= 1
            self._since = time.monotonic()

    def seconds(self) -> float:
        """Return the seconds for which everything has been in order; 0 while something is not."""
        return 0.0 if self._troubles else time.monotonic() - self._since
