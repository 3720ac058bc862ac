"""What became of the episodes of a recording: how many were kept, discarded and cut. No I/O."""

from typing import Literal

__all__ = ["EpisodeEnd", "EpisodeHistory"]

EpisodeEnd = Literal["kept", "discarded", "cut"]


class EpisodeHistory:
    """Call `begin` and `end` for each episode.

    Attributes:
        number: of the newest episode; all counts begin anew with each recording
        last: what became of the last one, in words
    """

    def __init__(self) -> None:
        self.number = self.kept = self.discarded = self.cuts = 0
        self.last = ""
        self._recording = ""

    def begin(self, recording: str) -> int:
        """Return the number of the episode that begins."""
        if recording != self._recording:
            self._recording = recording
            self.number = self.kept = self.discarded = self.cuts = 0
        self.number += 1
        return self.number

    def end(self, number: int, end: EpisodeEnd, why: str = "") -> None:
        """Take the end of an episode; `why` it was cut, in words."""
        self.kept += end == "kept"
        self.discarded += end == "discarded"
        self.cuts += end == "cut"
        self.last = f"episode {number} is lost: {why}" if end == "cut" else f"episode {number} is {end}"
