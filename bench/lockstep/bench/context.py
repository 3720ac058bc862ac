"""The context that every section is given."""

from collections.abc import Callable
from dataclasses import dataclass

__all__ = ["Context"]


@dataclass(frozen=True)
class Context:
    quick: bool  # fewer samples: to see that it works, not to quote
    robots: list[str]  # robots that start on this machine, the default one first
    say: Callable[[str], None]  # progress, for people

    def scale(self, count: int, quick: int) -> int:
        """Return the number of samples to take."""
        return quick if self.quick else count
