"""Reduces the number of a camera's pictures that each of many observers gets. No I/O.

| observers | pictures |
|---|---|
| up to the size of a crowd | all |
| more | every second |
| more than two and a half times as many | every third |
| more than the size, while they fill the event loop | a step fewer for each two seconds of that, down to every sixth |

The frame rate falls at once, and rises only after five seconds with a fifth fewer observers than the step requires:
somebody who comes and goes at the edge changes nothing. A step taken because the loop was full is undone when the loop
has room for it, one step at a time; a step that has to be taken again soon doubles the wait for the next one.
"""

__all__ = ["FULL", "LoadShedding"]

HUGE = 2.5  # times the size
EDGE = 0.8  # share of a step's observers below which the step is undone
AFTER = 5.0  # s
MOST = 6  # one picture of so many
FULL = 0.85  # of the loop's time: above it late frames are dropped, and the keyframes requested for them add work
ROOM = 0.8  # of the loop's time, which may be filled after a step is undone
PICTURES = 0.5  # share of the work for observers; the rest is sound, feedback and their own datagrams
FULL_LOOKS = 2  # consecutive
LONGEST = 160.0  # s, the longest wait


class LoadShedding:
    """The load shedding of one media hub."""

    def __init__(self, size: int) -> None:
        self.size = size  # observers who still get everything
        self._step = 1  # divisor of the camera's rate, by the number of observers
        self._fewer_since: float | None = None
        self._relief = 0  # further steps, by the load
        self._full_looks = 0
        self._room_since: float | None = None
        self._wait = AFTER  # s of room before a step is undone
        self._eased_at = float("-inf")

    @property
    def divisor(self) -> int:
        """The divisor of the frame rate: each observer gets one picture of so many."""
        return 1 if self._step == 1 else min(MOST, self._step + self._relief)

    def watch(self, observers: int, now: float) -> int:
        """Take the number of observers and return the divisor."""
        wanted = self._step_for(observers)
        if wanted > self._step:
            self._step = wanted
        eased = self._step_for(observers / EDGE)
        if eased >= self._step:
            self._fewer_since = None
        elif self._fewer_since is None:
            self._fewer_since = now
        elif now - self._fewer_since >= AFTER:
            self._step, self._fewer_since = eased, None
        return self.divisor

    def loaded(self, load: float, now: float) -> None:
        """Take the share of the loop's time that observers took since the last call, 0 to 1. Call it once a second."""
        if self._step == 1:
            self._relief, self._full_looks, self._room_since = 0, 0, None
            return
        self._full_looks = self._full_looks + 1 if load > FULL else 0
        if self._full_looks >= FULL_LOOKS and self.divisor < MOST:
            self._relief, self._full_looks = self._relief + 1, 0
            self._wait = min(LONGEST, 2 * self._wait) if now - self._eased_at < 2 * AFTER else self._wait
        if self._relief == 0 or load * (1 + PICTURES / (self.divisor - 1)) > ROOM:
            self._room_since = None
        elif self._room_since is None:
            self._room_since = now
        elif now - self._room_since >= self._wait:
            self._relief, self._room_since, self._eased_at = self._relief - 1, None, now

    def _step_for(self, observers: float) -> int:
        return 1 + (observers > self.size) + (observers > HUGE * self.size)
