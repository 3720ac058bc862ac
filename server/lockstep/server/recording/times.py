"""The clocks of a recording. No clock is read here."""

from lockstep.server.media.pipeline.capture_clock import CaptureClock

__all__ = ["LinkTimes", "RecordClock"]

SECOND = 1_000_000_000
STEP = 0.001  # s by which the estimate has to be another one before it is taken


class RecordClock:
    """Times of arrival: the wall clock at the start, advanced by the monotonic one; never goes back."""

    def __init__(self, wall: int, monotonic: int) -> None:
        """Both in ns."""
        self._offset = wall - monotonic

    def at(self, monotonic: float) -> int:
        """ns since 1970 at `monotonic`, in s."""
        return self._offset + round(monotonic * SECOND)


class LinkTimes:
    """From the robot bridge's monotonic clock to the console's. The mapping changes only with a feedback.

    So a reader gets the bridge's own time of a picture back, exactly: by the feedback before it. Of one that came
    sooner than the mapping allows, the time of its arrival is recorded.
    """

    def __init__(self) -> None:
        self._clock = CaptureClock()
        self._offset: float | None = None  # s

    def observe(self, link_time: float, now: float) -> None:
        """A feedback that was issued at `link_time` arrived now; both in s."""
        self._clock.observe(link_time, now)
        estimate = self._clock.wall_time(link_time) - link_time
        if self._offset is None or abs(estimate - self._offset) > STEP:
            self._offset = estimate

    def captured(self, link_time: float, now: float) -> float:
        """When that was on the console's clock, in s; `now` before the first feedback."""
        return now if self._offset is None else self._offset + link_time
