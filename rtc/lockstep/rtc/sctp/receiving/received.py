"""The chunks that have come, and the SACK that tells the peer of them (RFC 9260 6.2)."""

from bisect import bisect_left
from collections import deque

from lockstep.rtc.sctp.serial import MASK_32
from lockstep.rtc.sctp.settings import SctpSettings
from lockstep.rtc.sctp.wire.chunks import Sack

__all__ = ["ReceivedTsns"]

HALF = 1 << 31
FURTHEST = 0xFFFF  # a gap's offset has 16 bits
MOST_DUPLICATES = 32  # reported in one SACK
ENOUGH_BEYOND = 64  # chunks that came beyond a hole before it can count as given up


class ReceivedTsns:
    """The received TSNs: everything up to `cumulative`, and runs beyond it. TSNs are unwrapped."""

    def __init__(self, initial_tsn: int, settings: SctpSettings) -> None:
        self.cumulative = initial_tsn - 1
        self._max_gaps = settings.max_gaps
        self._runs: list[list[int]] = []  # [first, last], ascending, never adjacent
        self._duplicates: list[int] = []
        self._given_up_after = settings.given_up_after
        self._marks: deque[tuple[float, int]] = deque()

    @property
    def is_plain(self) -> bool:
        """True if the next SACK has neither gaps nor duplicates."""
        return not self._runs and not self._duplicates

    @property
    def has_gaps(self) -> bool:
        return bool(self._runs)

    def unwrap(self, tsn: int) -> int:
        near = self.cumulative  # `serial.unwrap` in place, for every chunk passes here
        return near - HALF + ((tsn - near + HALF) & MASK_32)

    def take(self, tsn: int, now: float) -> str:
        """Note one more TSN. Return "" if it is new and noted, otherwise the name of the reason not to use it."""
        if tsn == self.cumulative + 1 and not self._runs:  # nearly always
            self.cumulative = tsn
            return ""
        if tsn <= self.cumulative:
            return self._duplicate(tsn)
        if tsn - self.cumulative > FURTHEST:
            return "too_far_ahead"
        problem = self._insert(tsn)
        if not problem:
            self._advance()
            self._watch(now)
        return problem

    def _duplicate(self, tsn: int) -> str:
        if len(self._duplicates) < MOST_DUPLICATES:
            self._duplicates.append(tsn & MASK_32)
        return "duplicate"

    def _insert(self, tsn: int) -> str:
        runs = self._runs
        at = bisect_left(runs, [tsn])
        if (at < len(runs) and runs[at][0] == tsn) or (at and runs[at - 1][1] >= tsn):
            return self._duplicate(tsn)
        after = at < len(runs) and runs[at][0] == tsn + 1
        if at and runs[at - 1][1] == tsn - 1:
            runs[at - 1][1] = runs[at][1] if after else tsn
            if after:
                del runs[at]
        elif after:
            runs[at][0] = tsn
        elif len(runs) >= self._max_gaps and tsn != self.cumulative + 1:
            return "too_many_gaps"
        else:
            runs.insert(at, [tsn, tsn])
        return ""

    def forward(self, cumulative: int, now: float) -> None:
        """Move to `cumulative`: nothing up to there comes any more (RFC 3758 3.6)."""
        self.cumulative = max(self.cumulative, cumulative)
        self._advance()
        self._watch(now)

    def _advance(self) -> None:
        runs = self._runs
        passed = 0
        while passed < len(runs) and runs[passed][0] <= self.cumulative + 1:
            self.cumulative = max(self.cumulative, runs[passed][1])
            passed += 1
        del runs[:passed]

    def _watch(self, now: float) -> None:
        """Note the highest TSN of each second, while something is missing."""
        marks = self._marks
        if not self._runs:
            marks.clear()
        elif not marks or now - marks[-1][0] >= 1.0:
            marks.append((now, self._runs[-1][1]))
            while len(marks) > 1 and now - marks[1][0] >= self._given_up_after:
                marks.popleft()

    def given_up(self, now: float) -> int | None:
        """Return the TSN up to which chunks have been missing for so long that they were given up; None: no TSN."""
        if not self._marks or now - self._marks[0][0] < self._given_up_after:
            return None
        if sum(last - first + 1 for first, last in self._runs) < ENOUGH_BEYOND:
            return None
        highest = self._marks[0][1]
        return highest if highest > self.cumulative else None

    def sack(self, window: int, most_gaps: int) -> Sack:
        """Return the SACK for the peer; it reports duplicates once, and at most the first `most_gaps` gaps."""
        base = self.cumulative
        gaps = [(first - base, last - base) for first, last in self._runs[:most_gaps]] if self._runs else ()
        duplicates, self._duplicates = self._duplicates, []
        return Sack(base & MASK_32, window, gaps, duplicates)
