"""When a robot dials again, and how long it lets a try take. No I/O, no clock."""

import random

__all__ = ["RedialTimes"]

FIRST, SOON, LATE = 0.1, 0.5, 5.0  # s: the first wait, and the longest ones
SOON_TRIES = 120  # about two minutes of tries; then the console is not coming back soon
REFUSED = 10.0  # s, after a refusal that only a person can end
# A handshake that a cut has caught is given up. Every fourth try has time for a path with a long delay. Within a try,
# TCP connections race (tcp_race.py).
PATIENCE = (5.0, 5.0, 5.0, 10.0)  # s


class RedialTimes:
    """Call `wait` after every try that failed or link that ended, `patience` before a try, `healthy` with a link."""

    def __init__(self, jitter: random.Random) -> None:
        self._jitter = jitter
        self._tries = 0

    def patience(self) -> float:
        """Return the seconds that the next try may take."""
        return PATIENCE[self._tries % len(PATIENCE)]

    def wait(self, *, refused: bool) -> float:
        """Return seconds between half and all of the doubled wait, so that many robots do not come at once."""
        cap = SOON if self._tries < SOON_TRIES else LATE
        full = REFUSED if refused else min(cap, FIRST * 2.0 ** min(self._tries, 30))
        self._tries += 1
        return full * self._jitter.uniform(0.5, 1)

    def healthy(self) -> None:
        self._tries = 0
