"""Sums a count that begins at 0 again now and then, as a page's does with every new connection. No I/O."""

__all__ = ["RestartingTotal"]


class RestartingTotal:
    """The sum of a count over all its beginnings. What is counted between the last look and an end is lost."""

    def __init__(self) -> None:
        self._before = self._now = 0

    def see(self, value: int) -> None:
        """Take the count as it is now."""
        if value < self._now:
            self._before += self._now
        self._now = value

    @property
    def value(self) -> int:
        return self._before + self._now
