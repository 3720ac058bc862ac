"""Checks that no picture or sound is stamped with an event that began after its capture. No I/O."""

from typing import NamedTuple

from lockstep.protocol.serial import is_event, is_newer
from lockstep.server.recording.format.records import FeedbackRecord
from lockstep.server.recording.verify.violation import Violation

__all__ = ["StampChecks"]

ROUNDING = 2e-6  # s; times in the file are rounded to ns, capture times of sound to a sample
OVERTAKEN = 2_000_000  # µs; a picture may overtake its feedback, but not by that much
MOST_WAITING = 10_000


class _Medium(NamedTuple):
    """A picture or a sound."""

    stream: str
    stamp: int
    micros: int  # µs since 1970, arrival
    at: float  # s, capture, the bridge's clock


class StampChecks:
    """Show it feedbacks and media in the order of the file; each call returns what is wrong. Times are in ns."""

    def __init__(self) -> None:
        self._newest: FeedbackRecord | None = None
        self._began: dict[int, float] = {}  # by event, s, the bridge's clock
        self._offset = 0  # ns from the bridge's clock to the recording's
        self._waiting: list[_Medium] = []  # stamped with an event whose feedback is not here yet

    def feedback(self, feedback: FeedbackRecord, captured: int) -> list[Violation]:
        before, event = self._newest, feedback.event
        self._offset = captured - round(feedback.time * 1e9)
        if before is None:
            begins = feedback.issue == 1
        else:
            begins = is_newer(event, before.event)
            if not begins and event != before.event:
                return []
        if begins:
            self._began[event] = feedback.time
        self._newest = feedback
        waiting, self._waiting = self._waiting, []
        found: list[Violation] = []
        for medium in waiting:
            if is_newer(medium.stamp, event):
                self._waiting.append(medium)
            else:
                found += self._judge(medium)
        return found

    def medium(self, stream: str, stamp: int, arrived: int, captured: int) -> list[Violation]:
        """Take a picture or a sound of the robot."""
        medium = _Medium(stream, stamp, arrived // 1000, (captured - self._offset) / 1e9)
        if not is_event(stamp):
            return [Violation(stamp, medium.micros, f"{stream}: {stamp} is not an event")]
        if self._newest is not None and not is_newer(stamp, self._newest.event):
            return self._judge(medium)
        if len(self._waiting) < MOST_WAITING:
            self._waiting.append(medium)
        return []

    def end(self, ended: int) -> list[Violation]:
        """Take the end of the file, whose last record arrived at `ended` (µs)."""
        return [
            Violation(each.stamp, each.micros, f"{each.stream}: stamped with an event that is not recorded")
            for each in self._waiting
            if ended - each.micros > OVERTAKEN
        ]

    def _judge(self, medium: _Medium) -> list[Violation]:
        began = self._began.get(medium.stamp)
        if began is None or medium.at >= began - ROUNDING:
            return []
        text = f"{medium.stream}: captured {1000 * (began - medium.at):.1f} ms before its event began"
        return [Violation(medium.stamp, medium.micros, text)]
