"""Selects the pictures of a camera that a tier takes, evenly spaced. No clock is read here."""

__all__ = ["FrameDecimator"]


class FrameDecimator:
    """Thins the pictures of one tier. Call `take` for every picture, in the order of their times."""

    def __init__(self) -> None:
        self._due = float("-inf")

    def take(self, time: float, wanted_rate: float, source_rate: float) -> bool:
        """True if the picture captured at `time` (s) is to be encoded; pictures come at `source_rate`."""
        if wanted_rate >= 0.95 * source_rate:
            self._due = time
            return True
        if time < self._due - 0.5 / source_rate:
            return False
        interval = 1 / wanted_rate
        # A camera that paused does not catch up with a burst.
        self._due = (self._due if time - self._due < interval else time) + interval
        return True
