"""Observers' datagrams wait for their turn; operators and the robot never wait for them."""

from collections import deque
from collections.abc import Callable
from typing import Protocol

from lockstep.server.util.cooperative_scheduler import CooperativeScheduler

__all__ = ["DriverQueue", "DatagramQueue", "Waiting"]


class Waiting(Protocol):
    """Somebody whose datagrams wait."""

    def handle_next(self) -> bool:
        """Handle one; whether more wait."""


class DatagramQueue:
    """One datagram of each in turn, for at most a slice in each turn of the loop: who floods waits for himself."""

    def __init__(self, turns: CooperativeScheduler) -> None:
        self._turns = turns
        self._order: deque[Waiting] = deque()
        self._waiting: set[Waiting] = set()
        self._is_scheduled = False

    def may_go_at_once(self) -> bool:
        """Never."""
        return False

    def add(self, waiting: Waiting) -> None:
        """It has something to handle. Adding it again changes nothing."""
        if waiting not in self._waiting:
            self._waiting.add(waiting)
            self._order.append(waiting)
        self._schedule()

    def _schedule(self) -> None:
        if not self._is_scheduled:
            self._is_scheduled = True
            self._turns.ask(self._serve)

    def _serve(self) -> None:
        self._is_scheduled = False
        while self._order:
            waiting = self._order.popleft()
            if waiting.handle_next():
                self._order.append(waiting)
            else:
                self._waiting.discard(waiting)
            if self._turns.is_over():
                break
        if self._order:
            self._schedule()


class DriverQueue:
    """Of one peer that may drive: what it sends is handled at once while it does, and else within a bound."""

    def __init__(self, turns: DatagramQueue, may_go_at_once: Callable[[], bool]) -> None:
        """`turns`: where datagrams wait; `may_go_at_once`: the bound for all that may drive and do not, together."""
        self.drives = False  # whether it holds the control seat
        self._turns = turns
        self._bound = may_go_at_once

    def may_go_at_once(self) -> bool:
        return self.drives or self._bound()

    def add(self, waiting: Waiting) -> None:
        self._turns.add(waiting)
