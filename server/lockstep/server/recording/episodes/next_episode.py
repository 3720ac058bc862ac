"""What comes before an episode: the robot's reset, and the count-down. No I/O; the caller hands in `now`."""

from typing import Literal, NamedTuple

from lockstep.server.recording.episodes.episode_history import EpisodeHistory

__all__ = ["NextEpisode", "Wanted"]


class Wanted(NamedTuple):
    """An episode that is about to begin."""

    task: str
    by: str


class NextEpisode:
    """An episode that is wanted begins behind the reset, if one runs, and the count-down.

    Attributes:
        phase: of the table of EpisodeCore; idle also while an episode is open
        wanted: the episode that is about to begin, from the request to its begin; None: none is
    """

    def __init__(self, history: EpisodeHistory, *, countdown: float, resets: bool, reset_seconds: float) -> None:
        """`resets`: there is a reset action, to be run after each episode."""
        self.phase: Literal["idle", "resetting", "countdown"] = "idle"
        self.wanted: Wanted | None = None
        self._history = history
        self._countdown = countdown
        self._resets = resets
        self._reset_seconds = reset_seconds
        self._deadline = 0.0  # of the reset or the count-down

    @property
    def counting(self) -> Wanted | None:
        """The episode whose count-down runs, or is over."""
        return self.wanted if self.phase == "countdown" else None

    def seconds_left(self, now: float) -> float:
        """Return the rest of the count-down."""
        return max(0.0, self._deadline - now) if self.phase == "countdown" else 0.0

    def is_reset_late(self, now: float) -> bool:
        return self.phase == "resetting" and now >= self._deadline

    def want(self, task: str, by: str, now: float) -> None:
        """Take the request for an episode."""
        self.wanted = Wanted(task, by)
        if self.phase == "idle":
            self._count_down(now)

    def begin_reset(self, now: float) -> bool:
        """An episode has ended. Return whether the reset has to run."""
        if self._resets:
            self.phase, self._deadline = "resetting", now + self._reset_seconds
        return self._resets

    def end_reset(self, failure: str, now: float) -> None:
        """The reset has ended; `failure`: why it failed, "" if it did not. After a failure nothing begins."""
        self.phase = "idle"
        if failure:
            self.wanted = None
            self._history.last += f"; the reset failed: {failure}"
        elif self.wanted is not None:
            self._count_down(now)

    def begun(self) -> None:
        """The episode has begun."""
        self.phase, self.wanted = "idle", None

    def cancel(self, why: str = "", *, with_reset: bool = False) -> None:
        """Cancel the episode that is about to begin, if there is one. `why`: in words."""
        if self.phase == "countdown" or with_reset:
            self.phase = "idle"
        if self.wanted is not None:
            self.wanted = None
            self._history.cancel(why)

    def _count_down(self, now: float) -> None:
        self.phase, self._deadline = "countdown", now + self._countdown
