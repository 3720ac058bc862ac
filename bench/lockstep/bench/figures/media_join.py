"""Finds the captured picture of each shown one. No I/O.

RTP timestamps of a picture stream follow its capture times from an unknown start, at 90 kHz and to a tick exactly.
Capture times are never evenly spaced, so only one start fits all pictures: the one that most agree on.
"""

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

__all__ = ["Joined", "join_pictures"]

CLOCK_RATE = 90_000  # Hz
WRAP = 1 << 32
SLACK = 2  # ticks; capture times and their difference are rounded once each
MIN_SHARE = 0.5  # of the shown pictures that must agree on the start


class Joined(NamedTuple):
    captured: list[float | None]  # s, by shown picture; None: not one of the captured
    matched: int


def join_pictures(shown: Sequence[int], captured: Sequence[float]) -> Joined:
    """Join shown and captured pictures.

    `shown`: RTP timestamps in order; `captured`: capture times in s.

    Raises:
        ValueError: too few of them agree on a start; they do not belong together.
    """
    if not shown or not captured:
        raise ValueError("nothing to join")
    timeline = _unwrapped(shown)
    ticks = [round(time * CLOCK_RATE) for time in captured]
    start = _agreed_start(timeline, ticks)
    by_tick = dict(zip(ticks, captured, strict=True))
    found = [_near(by_tick, timestamp - start) for timestamp in timeline]
    matched = sum(time is not None for time in found)
    if matched < MIN_SHARE * len(shown):
        raise ValueError(f"only {matched} of {len(shown)} shown pictures fit the captured ones")
    return Joined(found, matched)


def _unwrapped(timestamps: Sequence[int]) -> list[int]:
    """Return the timestamps without the wrap of 32 bits."""
    found = [timestamps[0]]
    for timestamp in timestamps[1:]:
        ahead = (timestamp - found[-1]) % WRAP
        found.append(found[-1] + (ahead if ahead < WRAP // 2 else ahead - WRAP))
    return found


def _agreed_start(timeline: Sequence[int], ticks: Sequence[int]) -> int:
    """Return the start with the most votes: each pair of a shown and a captured picture votes for the one that fits."""
    votes = Counter(timestamp - tick for timestamp in timeline for tick in ticks)
    near = Counter({start: sum(votes[start + slack] for slack in (-1, 0, 1)) for start in votes})
    return near.most_common(1)[0][0]


def _near(by_tick: dict[int, float], tick: int) -> float | None:
    for slack in range(SLACK + 1):
        for candidate in (tick - slack, tick + slack):
            if candidate in by_tick:
                return by_tick[candidate]
    return None
