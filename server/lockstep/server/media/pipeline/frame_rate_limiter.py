"""Thins a camera's pictures to a frame rate. No I/O."""

__all__ = ["FrameRateLimiter"]

EARLY = 0.3  # of an interval that a picture may come before it is due: cameras jitter


class FrameRateLimiter:
    """Call `admit` for every picture, with its capture time. A rate of None lets all pass."""

    def __init__(self, frames_per_second: float | None) -> None:
        self._interval = 0.0 if frames_per_second is None else 1 / frames_per_second
        self._due: float | None = None

    def admit(self, time: float) -> bool:
        """True if the picture captured at `time` (s) is to be encoded."""
        if self._interval == 0:
            return True
        due = self._due
        if due is None or abs(time - due) > 2 * self._interval:  # the first, after a pause, or the clock began anew
            self._due = time + self._interval
            return True
        if time < due - EARLY * self._interval:
            return False
        self._due = due + self._interval  # not from now, so that the rate is met on average
        return True
