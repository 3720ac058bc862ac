"""Which of a camera's pictures a tier takes, so that they come evenly. No clock is read here."""

__all__ = ["FrameDecimator"]


class FrameDecimator:
    """Ask `take` for every picture, in the order of their times."""

    def __init__(self) -> None:
        self._due = float("-inf")

    def take(self, time: float, wanted_rate: float, source_rate: float) -> bool:
        """Whether to encode the picture captured at `time` (s), with pictures coming at `source_rate`."""
        if wanted_rate >= 0.95 * source_rate:
            self._due = time
            return True
        if time < self._due - 0.5 / source_rate:
            return False
        interval = 1 / wanted_rate
        # A camera that paused does not catch up with a burst.
        self._due = (self._due if time - self._due < interval else time) + interval
        return True
