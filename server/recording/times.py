"""The clocks of a recording. No clock is read here."""

from server.media.capture_clock import CaptureClock

__all__ = ["LinkTimes", "RecordClock"]

SECOND = 1_000_000_000
STEP = 1_000_000  # ns by which the estimate has to be another one before it is taken


class RecordClock:
    """Times of arrival: the wall clock at the start, advanced by the monotonic one; never goes back."""

    def __init__(self, wall: int, monotonic: int) -> None:
        """Both in ns."""
        self._offset = wall - monotonic

    def at(self, monotonic: float) -> int:
        """ns since 1970 at `monotonic`, in s."""
        return self._offset + round(monotonic * SECOND)


class LinkTimes:
    """From the robot bridge's monotonic clock to the recording's. The mapping changes only with a feedback.

    So a reader gets the bridge's own time of a picture back, exactly: by the feedback before it.
    """

    def __init__(self) -> None:
        self._clock = CaptureClock()
        self._offset: int | None = None  # ns
        self._origin = 0  # ns; keeps the estimator's floats small

    def observe(self, link_time: float, arrived: int) -> int:
        """A feedback of then arrived: its time of capture, in ns since 1970."""
        if self._offset is None:
            self._origin = arrived
        self._clock.observe(link_time, (arrived - self._origin) / SECOND)
        estimate = self._origin + round((self._clock.wall_time(link_time) - link_time) * SECOND)
        if self._offset is None or abs(estimate - self._offset) > STEP:
            self._offset = estimate
        return self.captured(link_time, arrived)

    def captured(self, link_time: float, arrived: int) -> int:
        """Of a medium; `arrived` itself before the first feedback."""
        return arrived if self._offset is None else self._offset + round(link_time * SECOND)
