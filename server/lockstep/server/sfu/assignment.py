"""Assigns observers to the console or to a relay. No I/O; reads no clock."""

from collections.abc import Mapping
from typing import NamedTuple

__all__ = ["Assignment"]

PENDING_SECONDS = 10.0  # a place is kept this long for an observer that was told of it and has not arrived


class _Promise(NamedTuple):
    relay: str  # "": direct
    until: float


class Assignment:
    """Up to `direct` observers connect to the console itself; the others go to the relay with the fewest."""

    def __init__(self, direct: int) -> None:
        self._direct = direct
        self._promises: list[_Promise] = []

    def choose(self, now: float, direct: int, relays: Mapping[str, int]) -> str:
        """Return the relay for one more observer; "" is the console itself.

        Args:
            direct: observers that get media from the console now
            relays: the relays that can be used, each with its present number of observers
        """
        self._promises = [promise for promise in self._promises if promise.until > now]
        choice = ""
        if relays and direct + self._promised("") >= self._direct:
            choice = min(relays, key=lambda relay: relays[relay] + self._promised(relay))
        self._promises.append(_Promise(choice, now + PENDING_SECONDS))
        return choice

    def arrived(self, relay: str) -> None:
        """Note that an observer has arrived at `relay`; the caller counts it from now on."""
        for promise in self._promises:
            if promise.relay == relay:
                self._promises.remove(promise)
                return

    def expected(self, now: float) -> bool:
        """Return whether an observer is on the way to a relay."""
        return any(promise.relay and promise.until > now for promise in self._promises)

    def full(self, now: float, direct: int) -> bool:
        """Return whether one more observer would have to go to a relay."""
        waiting = sum(promise.relay == "" and promise.until > now for promise in self._promises)
        return direct + waiting >= self._direct

    def _promised(self, relay: str) -> int:
        return sum(promise.relay == relay for promise in self._promises)
