"""Who watches where. No I/O, no clock is read here."""

from collections.abc import Mapping
from typing import NamedTuple

__all__ = ["Assignment"]

PENDING_SECONDS = 10.0  # that a place is kept for somebody who was told of it and is not there yet


class _Promise(NamedTuple):
    relay: str  # "": direct
    until: float


class Assignment:
    """Up to `direct` observers connect to the console itself; the others go where the fewest are."""

    def __init__(self, direct: int) -> None:
        self._direct = direct
        self._promises: list[_Promise] = []

    def choose(self, now: float, direct: int, relays: Mapping[str, int]) -> str:
        """The relay for one more observer; "" is the console itself.

        Args:
            direct: observers that get media from the console now
            relays: those that can be used, and how many observers each has now
        """
        self._promises = [promise for promise in self._promises if promise.until > now]
        choice = ""
        if relays and direct + self._promised("") >= self._direct:
            choice = min(relays, key=lambda relay: relays[relay] + self._promised(relay))
        self._promises.append(_Promise(choice, now + PENDING_SECONDS))
        return choice

    def arrived(self, relay: str) -> None:
        """Somebody who was sent there is there, and counted by the caller from now on."""
        for promise in self._promises:
            if promise.relay == relay:
                self._promises.remove(promise)
                return

    def expected(self, now: float) -> bool:
        """Whether anybody is on the way to a relay."""
        return any(promise.relay and promise.until > now for promise in self._promises)

    def full(self, now: float, direct: int) -> bool:
        """Whether one more observer would have to go to a relay."""
        waiting = sum(promise.relay == "" and promise.until > now for promise in self._promises)
        return direct + waiting >= self._direct

    def _promised(self, relay: str) -> int:
        return sum(promise.relay == relay for promise in self._promises)
