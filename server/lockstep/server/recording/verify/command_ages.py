"""Judges whether commands executed soon enough after the feedback that they answer. No I/O.

A recording has no time of execution, only that of the feedback after it, which is later by the tick, by the wait that
keeps the event rate, and by whatever held the bridge up. The bridge measures these parts (docs/traces.md).
"""

from collections import deque
from typing import NamedTuple

import msgspec

from lockstep.server.recording.format.records import FeedbackRecord, TraceRecord
from lockstep.server.recording.verify.violation import Violation

__all__ = ["ROOM", "CommandAges"]

ROOM = 0.25  # s, on top of max_event_age: for the measurement of the answered feedback, and for the tick
ROUNDING = 0.001  # s, of spans


class _Doubt(NamedTuple):
    """A command whose feedback came late."""

    event: int
    micros: int
    age: float  # s, from the feedback that it answers to its own
    most: float  # s
    voided: bool  # the robot rests and needs a neutral command, as after a tick that was held up

    def judged(self, record: TraceRecord | None) -> Violation | None:
        """Return what is wrong; `record`: the bridge's own spans of this command."""
        allowed = f"{self.most:g} s are allowed"
        spans = None if record is None else record.command
        found = () if spans is None else (spans.tick_wait_ms, spans.apply_ms, spans.rate_wait_ms)
        known = [span / 1000 for span in found if span is not msgspec.UNSET]
        arrived = self.age - sum(known)
        if len(known) < 3 or arrived < -ROUNDING:
            text = (
                f"executed at most {self.age:.3f} s after the feedback that it answers: when is not recorded; {allowed}"
            )
        elif arrived > self.most + ROOM:
            text = f"executed {arrived:.3f} s after the feedback that it answers; {allowed}"
        elif known[0] > ROOM and not self.voided:
            ticked = arrived + known[0]
            text = f"executed {ticked:.3f} s after the feedback that it answers, because its tick was late; {allowed}"
        else:
            return None
        return Violation(self.event, self.micros, text)


class CommandAges:
    """Call `executed` for each event, `trace` for each record of spans, and `settle` before the next event and at the
    end. Spans may be recorded before or after the feedback of their event.
    """

    def __init__(self) -> None:
        self._traces: deque[TraceRecord] = deque(maxlen=4)  # the newest with the bridge's spans
        self._doubt: _Doubt | None = None

    def executed(self, feedback: FeedbackRecord, age: float, most: float, micros: int) -> None:
        """Take the first feedback of an event. `age`: s since the one that its command answers.

        `most`: s that are allowed. Both are by the bridge's clock.
        """
        if age > most + ROOM:
            self._doubt = _Doubt(feedback.event, micros, age, most, feedback.neutral_needed)

    def trace(self, record: TraceRecord) -> None:
        """Take spans; those of the operator's page do not count."""
        if not record.peer and not record.stream:
            self._traces.append(record)

    def settle(self) -> Violation | None:
        """Return the newest event's command if it was, or may have been, too late."""
        doubt, self._doubt = self._doubt, None
        if doubt is None:
            return None
        return doubt.judged(next((trace for trace in self._traces if trace.event == doubt.event), None))
