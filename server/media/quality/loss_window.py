"""Loss over the last seconds, of all streams of a peer together. No clock is read here."""

from collections import deque

__all__ = ["LossWindow"]

WINDOW = 3.0  # s
ENOUGH = 30  # packets; of fewer, one lost packet says nothing


class LossWindow:
    """Sums receiver reports, so that a stream of few packets does not count as much as one of many."""

    def __init__(self) -> None:
        self.known = False  # whether any report came
        self._reports: deque[tuple[float, int, int]] = deque()  # when, lost, expected

    def add(self, lost: int, expected: int, now: float) -> None:
        self.known = True
        if expected > 0:
            self._reports.append((now, lost, expected))
        self._forget(now)

    def fraction(self, now: float) -> float:
        """0 to 1; 0 while too little is known."""
        self._forget(now)
        expected = sum(report[2] for report in self._reports)
        return 0.0 if expected < ENOUGH else sum(report[1] for report in self._reports) / expected

    def _forget(self, now: float) -> None:
        while self._reports and now - self._reports[0][0] > WINDOW:
            self._reports.popleft()
