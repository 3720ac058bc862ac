"""The gap in events between a peer's picture and its newest event: a sign of a limit, unless decreases do not help."""

__all__ = ["EventGap"]

NEAR_TOLERANCE = 0.75
NEAR_REPORTS = 2  # consecutive
KEPT_REPORTS = 20
TRIES = 2
REST = 30.0  # s


class EventGap:
    """Takes a peer's reports of the gap.

    Attributes:
        newest: the last report's gap, in events
        reports_near: consecutive reports in which the gap was near the tolerance, and had been smaller before
    """

    def __init__(self) -> None:
        self.newest = 0
        self.reports_near = 0
        self._recent: list[int] = []  # gaps of the last reports
        self._tries: list[int] = []  # gap at each decrease for it
        self._rests_until = 0.0

    def report(self, gap: int, tolerance: int) -> None:
        """Take the largest gap since the last report, and the tolerance; both in events."""
        usual = min(self._recent, default=gap)
        near = tolerance > 0 and gap >= NEAR_TOLERANCE * tolerance and gap > usual
        self.reports_near = self.reports_near + 1 if near else 0
        self._recent = [*self._recent[1 - KEPT_REPORTS :], gap]
        self.newest = gap

    def is_near(self, now: float) -> bool:
        """Return whether the gap is near the tolerance and may be caused by the rate."""
        return self.reports_near >= NEAR_REPORTS and now >= self._rests_until

    def try_decrease(self, now: float) -> bool:
        """Return whether to decrease the rate for the gap, which is near; if decreases did not narrow it, ignore it."""
        narrowed = bool(self._tries) and self.newest < self._tries[0]
        if len(self._tries) >= TRIES and not narrowed:
            self._rests_until = now + REST
            self._tries = []
            return False
        self._tries = [self.newest] if narrowed else [*self._tries, self.newest]
        self.reports_near = 0
        return True
