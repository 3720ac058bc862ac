"""Loss over the last seconds, of all streams of a peer together. No clock is read here."""

from collections import deque

__all__ = ["LossWindow"]

WINDOW = 3.0  # s
ENOUGH = 30  # packets; of fewer, one lost packet says nothing
USUAL_SECONDS = 8.0  # over which the usual loss is averaged
UNUSUAL = 1.5  # times the usual loss


class LossWindow:
    """Sums receiver reports, so that a stream of few packets does not count as much as one of many."""

    def __init__(self) -> None:
        self.known = False  # True after the first report
        self.usual = 0.0  # 0 to 1
        self._reports: deque[tuple[float, int, int]] = deque()  # time, lost, expected
        self._at: float | None = None

    def add(self, lost: int, expected: int, now: float) -> None:
        self.known = True
        if expected > 0:
            self._reports.append((now, lost, expected))
        fraction = self.fraction(now)
        if self._at is not None:
            self.usual += (fraction - self.usual) * min(1.0, max(0.0, now - self._at) / USUAL_SECONDS)
        self._at = now

    def fraction(self, now: float) -> float:
        """Return the loss, 0 to 1; 0 while too little is known."""
        while self._reports and now - self._reports[0][0] > WINDOW:
            self._reports.popleft()
        expected = sum(report[2] for report in self._reports)
        return 0.0 if expected < ENOUGH else sum(report[1] for report in self._reports) / expected

    def unusual(self, now: float) -> float:
        """Return the loss if it is clearly above the usual loss of the path; else 0."""
        fraction = self.fraction(now)
        return fraction if fraction > UNUSUAL * self.usual else 0.0
