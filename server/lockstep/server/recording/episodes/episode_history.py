"""What became of the episodes of a recording: how many were kept, discarded and cut. No I/O."""

from typing import Literal

from lockstep.protocol.episodes import EpisodeCut

__all__ = ["CUT_WORDS", "EpisodeHistory"]

CUT_WORDS: dict[EpisodeCut, str] = {
    "epoch": "the robot bridge was restarted",
    "link_down": "the robot link was lost",
    "recording_ended": "the recording ended",
    "recording_failed": "the recording failed",
    "new_part": "the recording went on in another file",
    "console_ended": "the console ended",
}


class EpisodeHistory:
    """Call `begin` for each episode, then `keep`, `discard` or `cut`; `cancel` for one that did not begin.

    Attributes:
        number: of the newest episode; all counts begin anew with each recording
        last: what became of the last one, in words
        lost: why the last one was lost; "": it was not
        last_id: the last one; "": it did not begin
    """

    def __init__(self) -> None:
        self.number = self.kept = self.discarded = self.cuts = 0
        self.last = self.last_id = ""
        self.lost: EpisodeCut | Literal[""] = ""
        self._recording = ""

    def begin(self, recording: str) -> int:
        """Return the number of the episode that begins."""
        if recording != self._recording:
            self._recording = recording
            self.number = self.kept = self.discarded = self.cuts = 0
        self.number += 1
        return self.number

    def keep(self, id: str, number: int) -> None:
        """The episode is on the disk."""
        self.kept += 1
        self.last_id, self.last, self.lost = id, f"episode {number} is kept", ""

    def discard(self, id: str, number: int) -> None:
        """A person discarded the episode."""
        self.discarded += 1
        self.last_id, self.last, self.lost = id, f"episode {number} is discarded", ""

    def cut(self, id: str, number: int, why: EpisodeCut) -> None:
        """Something else than a person ended the episode."""
        self.cuts += 1
        self.last_id, self.last, self.lost = id, _lost_words(number, why), why

    def begin_after(self, id: str, number: int, state: str, why: EpisodeCut) -> None:
        """Say what became of an episode that an earlier process has recorded, unless there is a newer one.

        It is in no count.

        Args:
            state: "kept", "discarded", or another word: it is lost
            why: it is lost
        """
        if self.number or self.last:
            return
        self.last_id, self.number = id, number
        if state in ("kept", "discarded"):
            self.last, self.lost = f"episode {number} is {state}", ""
        else:
            self.last, self.lost = _lost_words(number, why), why

    def cancel(self, why: str) -> None:
        """The episode was cancelled before it began; `why`: in words, or ""."""
        self.last_id, self.last, self.lost = "", f"cancelled before it began: {why}".rstrip(": "), ""


def _lost_words(number: int, why: EpisodeCut) -> str:
    return f"episode {number} is lost: {CUT_WORDS[why]}"
