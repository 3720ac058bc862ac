"""Decides whether a robot that encodes makes second encodings for observers, and with how many bits. No I/O.

| second encodings | when | then |
|---|---|---|
| off | observers were due 1.5 times the operator's for 5 s, nothing waits | on, with 1.2 times the operator's |
| on | nothing waits on the uplink, and both encodings use what they may | up by 25 % a second |
| on | half of the operator's pictures wait for more than 0.03 s | both have 85 % of what arrives, no more for a while |
| on | that leaves too little, the uplink shows a limit, or no picture came for 3 s | off for a while |

It begins with more where the uplink carried more within the last minute, and not within 5 s of a limit. A while is
10 s, and twice as long each time, up to 640 s; 10 s again after a minute in which nothing waited. So an
uplink without room, or one that is wide for less than a minute at a time, is tried ever more seldom.

The bridge sends no picture of a second encoding while something waits on its path (docs/quality.md, "The second
encoding"), so a queue of second pictures is gone within half a second, and comes again. The least delayed medium
therefore never shows it; the operator's pictures, which wait in it, do.
"""

from typing import NamedTuple

__all__ = ["SecondShare", "UplinkNow"]

WANTED_SECONDS = 5.0
WORTH = 1.5  # of the operator's bits, that observers have to be due
START, KEEP = 1.2, 1.1  # of the operator's bits: with which a second encoding begins, and down to which it goes on
MARGIN = 0.85  # of what the uplink carried without a queue, for both encodings together
GROWTH = 1.25  # a second
USED = 0.6  # of what both encodings may have, from which more can be tried
EMPTY, QUEUE = 0.02, 0.03  # s that half of the operator's pictures waited
CUT = 0.85  # of what arrives while something waits
HOLD = 1.0  # s after a cut, besides the time that pictures waited: `waits` looks back so far
QUIET_SECONDS = 5.0
STEADY_SECONDS = 60.0
PATIENCE, MOST_PATIENCE = 10.0, 640.0  # s
SILENCE = 3.0  # s


class UplinkNow(NamedTuple):
    """What is known of the robot's uplink; bits per second without those of sound."""

    shown_bps: float  # that it lately carried without a queue
    carried_bps: float  # that arrive now
    waits: float | None  # s, the median wait of the operator's pictures of the last second; None: unknown
    limited_at: float  # s, when it showed a limit last


class SecondShare:
    """Call `decide` ten times a second, and `came` for each picture of a second encoding.

    Attributes:
        on: True while second encodings are made
    """

    def __init__(self) -> None:
        self.on = False
        self._wanted_since: float | None = None  # None: nobody is due more
        self._patience = PATIENCE
        self._not_before = float("-inf")  # s; time of the next beginning
        self._began = 0.0  # s
        self._came = 0.0  # time of the newest picture, or of the beginning
        self._cut_at = 0.0  # time of the last cut, or of the beginning
        self._total = 0.0  # bits per second of both encodings together
        self._ceiling = float("inf")  # of these, until `_more_at`
        self._more_at = self._hold_until = float("-inf")  # s
        self._decided_at = 0.0  # s

    def came(self, now: float) -> None:
        """A picture of a second encoding arrived."""
        self._came = now

    def decide(self, now: float, *, first_bps: float, most_bps: float, uplink: UplinkNow) -> float:
        """Return the bits per second of all second encodings together; 0 for none.

        Args:
            first_bps: of all first encodings
            most_bps: that observers can use; 0: nobody is due more than the operator's pictures
        """
        passed, self._decided_at = min(1.0, max(0.0, now - self._decided_at)), now
        if most_bps < WORTH * first_bps or most_bps <= 0:
            self._wanted_since, self.on = None, False
            return 0.0
        if self._wanted_since is None:
            self._wanted_since = now
        if self.on:
            self._follow(now, passed, first_bps + most_bps, uplink)
            if self.on and self._total - first_bps < KEEP * first_bps:
                self._fail(now)
        elif self._is_time(now, self._wanted_since, uplink):
            self.on, self._began, self._came, self._cut_at = True, now, now, now
            self._total = max(MARGIN * uplink.shown_bps, (1 + START) * first_bps)
            self._ceiling, self._hold_until = float("inf"), float("-inf")
        return min(most_bps, self._total - first_bps) if self.on else 0.0

    def _is_time(self, now: float, wanted_since: float, uplink: UplinkNow) -> bool:
        is_quiet = now - uplink.limited_at >= QUIET_SECONDS and uplink.waits is not None and uplink.waits < QUEUE
        return is_quiet and now >= self._not_before and now - wanted_since >= WANTED_SECONDS

    def _follow(self, now: float, passed: float, most_bps: float, uplink: UplinkNow) -> None:
        """Give both encodings less when pictures wait, and more while they do not. `most_bps`: of both together."""
        if uplink.limited_at > self._began or now - self._came > SILENCE:
            self._fail(now)
            return
        if uplink.waits is None or now < self._hold_until:
            return
        if uplink.waits > QUEUE:
            self._cut_at = now
            self._total = self._ceiling = min(self._total, CUT * uplink.carried_bps)
            self._hold_until = now + HOLD + uplink.waits
            self._more_at = now + self._wait_longer()
            return
        if now - self._cut_at >= STEADY_SECONDS:
            self._patience = PATIENCE
        if uplink.waits < EMPTY and uplink.carried_bps >= USED * self._total:
            ceiling = float("inf") if now >= self._more_at else self._ceiling
            grown = min(self._total * GROWTH**passed, most_bps, ceiling)
            self._total = max(self._total, grown)

    def _fail(self, now: float) -> None:
        self.on = False
        self._not_before = now + self._wait_longer()

    def _wait_longer(self) -> float:
        """Return how long to wait now; the next time it is twice as long."""
        patience, self._patience = self._patience, min(MOST_PATIENCE, 2 * self._patience)
        return patience
