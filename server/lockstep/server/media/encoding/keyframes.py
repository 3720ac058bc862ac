"""Schedules keyframes, from the merged requests of all peers. No clock is read here."""

from dataclasses import dataclass

__all__ = ["KeyframeScheduler"]

JOIN_BURST = 3
BACKOFF = 1.6  # times the spacing, for each request that comes soon after it could be served
MOST_SPACING = 1.0  # s
SOON = 2.0  # spacings
SPARING = 6.0  # times the interval
OTHERS_SPACING = 5.0  # s between keyframes for others than the operator, while the path has no room


@dataclass
class _Asked:
    joined: bool = False
    requested: bool = False


class KeyframeScheduler:
    """The schedule of one encoder. Call `join` and `request` at any time, and `take` before each picture is encoded.

    A joining peer is served with the next picture. Many at once would make every picture a keyframe, which the
    operator would pay for, so joins beyond a burst of three wait for the spacing, as requests do.

    A keyframe costs as much as many pictures, and on a full path it causes the next loss: when requests keep coming,
    the spacing between the keyframes that answer them grows, and it shrinks again when they cease. While the path has
    no room, others than the operator wait for a keyframe that the operator needs, or until the last is 5 s old.
    """

    def __init__(self, interval_seconds: float, spacing_seconds: float) -> None:
        # The path has no room: keyframes that nobody asked for come six times more rarely, those for others than the
        # operator at most every 5 s.
        self.sparing = False
        self.longest: float | None = None  # s between keyframes, twice that while sparing; None: the interval counts
        self._interval = interval_seconds
        self._least_spacing = spacing_seconds
        self._spacing = spacing_seconds
        self._first, self._others = _Asked(), _Asked()  # what the operator asked for, and what all others did
        self._last: float | None = None  # time of the last keyframe
        self._tokens = float(JOIN_BURST)
        self._tokens_at: float | None = None

    def join(self, *, other: bool = False) -> None:
        """Request a keyframe for a peer that joined and shows nothing without one.

        `other`: somebody drives, and it is another peer.
        """
        (self._others if other else self._first).joined = True

    def request(self, *, other: bool = False) -> None:
        """Request a keyframe for a peer that lost the picture (PLI, FIR) or had frames dropped. `other`: see `join`."""
        (self._others if other else self._first).requested = True

    def take(self, now: float) -> bool:
        """True if the picture about to be encoded must be a keyframe, which then serves all waiting requests."""
        if not self._wanted(now):
            return False
        if self._prompt().requested and self._last is not None:
            self._adapt(now - self._last)
        self.served(now)
        return True

    def served(self, now: float) -> None:
        """A keyframe came that somebody else made: it serves all that was requested until now."""
        self._first, self._others = _Asked(), _Asked()
        self._last = now

    def _prompt(self) -> _Asked:
        """Return the requests that do not wait until the last keyframe is old."""
        first, others = self._first, self._others
        if self.sparing:
            return first
        return _Asked(first.joined or others.joined, first.requested or others.requested)

    def _adapt(self, passed: float) -> None:
        if passed < SOON * self._spacing:
            self._spacing = min(max(MOST_SPACING, self._least_spacing), self._spacing * BACKOFF)
        else:
            self._spacing = max(self._least_spacing, self._spacing / BACKOFF)

    def _wanted(self, now: float) -> bool:
        interval = self._interval * (SPARING if self.sparing else 1)
        if self.longest is not None:
            interval = min(interval, self.longest * (2 if self.sparing else 1))
        if self._last is None or now - self._last >= interval:
            return True
        if self._others != _Asked() and now - self._last >= max(OTHERS_SPACING, self._least_spacing):
            return True
        prompt = self._prompt()
        spacing = self._least_spacing if prompt.joined else self._spacing
        if (prompt.joined or prompt.requested) and now - self._last >= spacing:
            return True
        return prompt.joined and self._spend_token(now)

    def _spend_token(self, now: float) -> bool:
        if self._tokens_at is not None and self._least_spacing > 0:
            self._tokens = min(JOIN_BURST, self._tokens + (now - self._tokens_at) / self._least_spacing)
        self._tokens_at = now
        if self._tokens < 1:
            return False
        self._tokens -= 1
        return True
