"""Decides what to do about a queue in the network that stays: lower the rate, wait, or take the path for longer."""

from lockstep.server.media.quality.path.round_trips import RoundTrips

__all__ = ["StandingQueue"]

DRAINS = 0.8  # share of its former length below which a queue drains
TRIES = 3  # decreases that do not shorten the queue


class StandingQueue:
    """The queue of one path, while there is one."""

    def __init__(self, trips: RoundTrips) -> None:
        self._trips = trips
        self._tries: list[float] = []  # queue at each decrease for it
        self._then = 0.0  # queue at the last decrease

    def try_decrease(self, *, recently: bool, lossy: bool) -> bool:
        """Return whether to decrease the rate for the queue, which is too long.

        Args:
            recently: the last decrease belongs to this queue
            lossy: packets are lost: an overflowing queue is not a longer path
        """
        trips = self._trips
        if recently and trips.growth == 0 and trips.queue < DRAINS * self._then:
            return False
        if self._tries and trips.queue < DRAINS * self._tries[0]:
            self._tries = []
        if not lossy:
            self._tries.append(trips.queue)
        if len(self._tries) > TRIES:
            trips.accept()
            self._tries = []
            return False
        self._then = trips.queue
        return True

    def gone(self) -> None:
        """Note that there is no queue."""
        self._tries = []
