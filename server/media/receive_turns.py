"""Observers' datagrams wait for their turn; operators and the robot never wait for them."""

from collections import deque
from collections.abc import Callable
from typing import Protocol

from server.loop_turns import turns_of_loop

__all__ = ["ReceiveTurns", "Waiting"]

SLICE = 0.00025  # s; each of the operator's messages waits for one or two of them


class Waiting(Protocol):
    """Somebody whose datagrams wait."""

    def handle_next(self) -> bool:
        """Handle one; whether more wait."""


class ReceiveTurns:
    """One datagram of each in turn, for at most a slice in each turn of the loop: who floods waits for himself."""

    def __init__(self, clock: Callable[[], float], slice_seconds: float = SLICE) -> None:
        self._clock = clock
        self._slice = slice_seconds
        self._order: deque[Waiting] = deque()
        self._waiting: set[Waiting] = set()
        self._is_scheduled = False

    def add(self, waiting: Waiting) -> None:
        """It has something to handle. Adding it again changes nothing."""
        if waiting not in self._waiting:
            self._waiting.add(waiting)
            self._order.append(waiting)
        self._schedule()

    def _schedule(self) -> None:
        if not self._is_scheduled:
            self._is_scheduled = True
            turns_of_loop().ask(self._serve)

    def _serve(self) -> None:
        self._is_scheduled = False
        deadline = self._clock() + self._slice
        while self._order:
            waiting = self._order.popleft()
            if waiting.handle_next():
                self._order.append(waiting)
            else:
                self._waiting.discard(waiting)
            if self._clock() >= deadline:
                break
        if self._order:
            self._schedule()
