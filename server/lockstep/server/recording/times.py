"""The clocks of a recording. No clock is read here."""

from lockstep.server.media.pipeline.capture_clock import CaptureClock

__all__ = ["RobotLinkTimes", "RecordClock"]

SECOND = 1_000_000_000
STEP = 0.001  # s by which the estimate has to change before it is taken


class RecordClock:
    """Times of arrival: the wall clock at the start, advanced by the monotonic one; never goes back."""

    def __init__(self, wall: int, monotonic: int) -> None:
        """Both times are in ns."""
        self._offset = wall - monotonic

    def at(self, monotonic: float) -> int:
        """Return ns since 1970 at `monotonic`, in s."""
        return self._offset + round(monotonic * SECOND)


class RobotLinkTimes:
    """Maps the robot bridge's monotonic clock to the console's. The mapping changes only with a feedback.

    So a reader gets the bridge's own time of a picture back exactly, by the feedback before it. A picture that came
    sooner than the mapping allows is recorded with the time of its arrival.
    """

    def __init__(self) -> None:
        self._clock = CaptureClock()
        self._offset: float | None = None  # s

    def observe(self, link_time: float, now: float) -> None:
        """Take a feedback that was issued at `link_time` and arrived now; both in s."""
        self._clock.observe(link_time, now)
        estimate = self._clock.wall_time(link_time) - link_time
        if self._offset is None or abs(estimate - self._offset) > STEP:
            self._offset = estimate

    def captured(self, link_time: float, now: float) -> float:
        """Return `link_time` on the console's clock, in s; `now` before the first feedback."""
        return now if self._offset is None else self._offset + link_time
