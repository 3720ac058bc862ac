"""Which episodes somebody wants: by task, outcome, driver and what the live checks have seen. No I/O."""

from collections.abc import Sequence
from typing import Protocol

import msgspec

from lockstep.protocol.episodes import EpisodeOutcome

__all__ = ["EpisodeFilter"]


class _Episode(Protocol):
    @property
    def task(self) -> str: ...
    @property
    def outcome(self) -> EpisodeOutcome: ...
    @property
    def drivers(self) -> Sequence[str]: ...
    @property
    def problems(self) -> Sequence[str]: ...


class EpisodeFilter(msgspec.Struct, frozen=True, kw_only=True):
    """What an episode must have. An empty list: anything."""

    tasks: list[str] = []  # one of these
    outcomes: list[EpisodeOutcome] = []  # one of these; "": nobody has said one
    drivers: list[str] = []  # one of these drove in it
    without_problems: bool = False  # the live checks have seen none

    def __bool__(self) -> bool:
        """Whether it may leave an episode out."""
        return self != EpisodeFilter()

    def why_not(self, episode: _Episode) -> str:
        """Return in words why the episode is not wanted; "" if it is."""
        if self.tasks and episode.task not in self.tasks:
            return f"its task is {episode.task!r}"
        if self.outcomes and episode.outcome not in self.outcomes:
            return f"its outcome is {episode.outcome or 'none'}"
        if self.drivers and not set(self.drivers) & set(episode.drivers):
            return f"its drivers are {', '.join(episode.drivers) or 'not known'}"
        if self.without_problems and episode.problems:
            return f"the live checks saw {', '.join(episode.problems)}"
        return ""
