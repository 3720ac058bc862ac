"""Simulates the thesis' sound player on the segments that came. No I/O.

The thesis heard sound with RAT, between 0 and 2000 ms late. Its rule, by its published source: a spurt of sound is
played at capture + the transit of the spurt's first segment + an offset, the larger of the measured jitter and half the
time between two segments, the latter within the two limits. A segment that comes after its moment is thrown away. After
some of these in a row a new spurt begins, which is how the delay grows; within a spurt it does not change. Left out are
RAT's reaction to a jump of the media time (a new spurt too), its measure of a delay spike, and its catching up when its
sound card runs dry.
"""

from bisect import bisect_right
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from lockstep.bench.experiment.judge.record import Arrival
from lockstep.protocol.serial import event_gap

__all__ = ["Heard", "Played", "SoundPlayer", "heard", "played"]

MINIMUM = 0.0  # s; tables 4.3, 4.6 and 4.9
MAXIMUM = 2.0
FIRST_JITTER = 0.060  # s; three segments
JITTER_SHARE = 1 / 8  # of a new difference in the running estimate
LATE_IN_A_ROW = 4  # thrown away, before a new spurt begins
SEGMENT = 0.020  # s from one to the next


class Played(NamedTuple):
    at: float  # s, moment at which it is heard
    stamp: int
    delay: float  # s since its capture


class SoundPlayer:
    """Decides about each segment, in the order in which they come."""

    def __init__(self) -> None:
        self._jitter = FIRST_JITTER
        self._offset: float | None = None  # s from capture to playing, of this spurt; None before the first
        self._last_transit = 0.0
        self._late = 0  # segments in a row

    def delay(self, transit: float) -> float | None:
        """Return s from a segment's capture until it is heard; None if that has passed. `transit`: s until it came."""
        if self._offset is None or self._late >= LATE_IN_A_ROW:
            variable = min(MAXIMUM, max(MINIMUM, SEGMENT / 2))
            self._offset, self._late = transit + max(self._jitter, variable), 0
        else:
            self._jitter += (abs(transit - self._last_transit) - self._jitter) * JITTER_SHARE
        self._last_transit = transit
        if transit > self._offset:
            self._late += 1
            return None
        self._late = 0
        return self._offset


def played(segments: Iterable[tuple[float, int, float]]) -> list[Played]:
    """Return the segments that are heard, of those that came, each (when, stamp, its age then)."""
    player = SoundPlayer()
    found = []
    for at, stamp, age in segments:
        delay = player.delay(age)
        if delay is not None:
            found.append(Played(at - age + delay, stamp, delay))
    return found


class Heard(NamedTuple):
    """The figures of all segments that came."""

    max_gap: int
    beyond_tolerance: int
    thrown_away: int
    longest_delay: float  # s since the capture


def heard(feedbacks: Sequence[Arrival], segments: Sequence[tuple[float, int, float]], tolerance: int) -> Heard:
    """Return how far the robot was ahead of the played sound, by the feedback that had come at each moment."""
    times = [each.at for each in feedbacks]
    sounds = played(segments)
    gaps = [
        abs(event_gap(feedbacks[newest - 1].event, sound.stamp))
        for sound in sounds
        if (newest := bisect_right(times, sound.at))
    ]
    return Heard(
        max(gaps, default=0),
        sum(gap > tolerance for gap in gaps),
        len(segments) - len(sounds),
        max((sound.delay for sound in sounds), default=0.0),
    )
