"""What became of the episodes of a recording: how many were kept, discarded and cut. No I/O."""

from typing import Literal

from lockstep.protocol.episodes import EpisodeCut

__all__ = ["EpisodeHistory"]


class EpisodeHistory:
    """Call `begin` for each episode, then `keep`, `discard` or `cut`; `cancel` for one that did not begin.

    Attributes:
        number: of the newest episode; all counts begin anew with each recording
        last: what became of the last one, in words
        lost: why the last one was lost; "": it was not
    """

    def __init__(self) -> None:
        self.number = self.kept = self.discarded = self.cuts = 0
        self.last = ""
        self.lost: EpisodeCut | Literal[""] = ""
        self._recording = ""

    def begin(self, recording: str) -> int:
        """Return the number of the episode that begins."""
        if recording != self._recording:
            self._recording = recording
            self.number = self.kept = self.discarded = self.cuts = 0
        self.number += 1
        return self.number

    def keep(self, number: int) -> None:
        """The episode is on the disk."""
        self.kept += 1
        self.last, self.lost = f"episode {number} is kept", ""

    def discard(self, number: int) -> None:
        """A person discarded the episode."""
        self.discarded += 1
        self.last, self.lost = f"episode {number} is discarded", ""

    def cut(self, number: int, why: EpisodeCut, words: str) -> None:
        """Something else than a person ended the episode; `words` say why."""
        self.cuts += 1
        self.last, self.lost = f"episode {number} is lost: {words}", why

    def cancel(self, why: str) -> None:
        """The episode was cancelled before it began; `why`: in words, or ""."""
        self.last, self.lost = f"cancelled before it began: {why}".rstrip(": "), ""
