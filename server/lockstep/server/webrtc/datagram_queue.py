"""Queues observers' datagrams; operators and the robot never wait for them."""

from collections import deque
from collections.abc import Callable
from typing import Protocol

from lockstep.rtc.token_bucket import TokenBucket
from lockstep.server.util.cooperative_scheduler import CooperativeScheduler

__all__ = ["DatagramQueue", "DatagramQueues", "DriverQueue", "Waiting"]

NOT_DRIVING_RATE = 1000.0  # Hz, datagrams of all peers that may drive but do not, before theirs wait as observers' do


class Waiting(Protocol):
    """A peer whose datagrams wait."""

    def handle_next(self) -> bool:
        """Handle one; True if more wait."""


class DatagramQueue:
    """Handles one datagram of each peer in turn, at most a slice per loop iteration: a flood delays only its sender."""

    def __init__(self, turns: CooperativeScheduler) -> None:
        self._turns = turns
        self._order: deque[Waiting] = deque()
        self._waiting: set[Waiting] = set()
        self._is_scheduled = False

    def may_go_at_once(self) -> bool:
        """False: datagrams always wait."""
        return False

    def add(self, waiting: Waiting) -> None:
        """Add a peer that has datagrams to handle. Adding it again changes nothing."""
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
    """The queue of one peer that may drive: its datagrams are handled at once while it drives, else within a bound."""

    def __init__(self, turns: DatagramQueue, may_go_at_once: Callable[[], bool]) -> None:
        """`turns`: the queue of datagrams that wait; `may_go_at_once`: the common bound of peers that do not drive."""
        self.drives = False  # True while it holds the control seat
        self._turns = turns
        self._bound = may_go_at_once

    def may_go_at_once(self) -> bool:
        return self.drives or self._bound()

    def add(self, waiting: Waiting) -> None:
        self._turns.add(waiting)


class DatagramQueues:
    """The datagram queues of all peers of one robot.

    Attributes:
        observers: the queue of observers' datagrams, which publishers' datagrams share
    """

    def __init__(self, turns: CooperativeScheduler, clock: Callable[[], float]) -> None:
        self.observers = DatagramQueue(turns)
        self._not_driving = TokenBucket(NOT_DRIVING_RATE, NOT_DRIVING_RATE)
        self._clock = clock

    def create(self, *, waits: bool) -> DatagramQueue | DriverQueue:
        """Return the datagram queue for a new peer.

        `waits`: its datagrams wait in observers' turns; otherwise only those above the rate do, unless it drives.
        """
        return self.observers if waits else DriverQueue(self.observers, self._may_go_at_once)

    def _may_go_at_once(self) -> bool:
        """True if one more datagram of the peers that may drive but do not is handled before all waiting ones."""
        return self._not_driving.take(self._clock())
