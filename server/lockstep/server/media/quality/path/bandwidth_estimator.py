"""Estimates the bitrate of pictures that one peer's path carries: the core of the quality controller. No I/O.

The rules are evaluated ten times a second, and the first that holds decides. Two decreases are at least as far apart
as the first needs to show its effect: the round trip and half a second.

| when | the rate becomes | reason |
|---|---|---|
| pictures leave and nothing was heard for 2 s (at first 5 s) and a round trip | 70 %, every second | no feedback |
| round trips grew beyond their spread | 85 % of the rate carried, after a pause | round trip |
| the peer's estimate fell, and a queue, loss or the gap confirms it | the estimate | bandwidth |
| the gap nears the tolerance and was smaller before, in two consecutive reports | 80 % | gap |
| more than 10 % is lost | by half the loss; without a queue not below half of what it was | loss |
| 2 to 10 % is lost, or the estimate fell, or a queue begins, or the console itself is late | stays | |
| none of these for a second, the rate is used, and something was heard since the last increase | see below | |

The pause is as long as the queue, a second at most: meanwhile the pictures that wait in the queue arrive, and the next
one finds an empty path.

The rate increases by 35 % every second until it meets its first limit; after that by 12 % a second up to 85 % of the
last limit, and by 4 % beyond. After a silence it returns at once to half of the rate before.

A symptom that decreases do not cure is not caused by the rate: when three of them did not shorten the round trips by a
fifth, and nothing is lost, the path has become longer and its new length counts; when two did not narrow the gap, the
gap is ignored for half a minute; loss without a queue costs half the rate at most, and the usual loss nothing. A rate
that an undemanding picture does not use is neither raised nor lowered.

In the words of RFC 8836: round trips and the receiver's own delay-based estimate (REMB, which Chromium and aiortc make
from abs-send-time) detect the standing queue, loss is only the last resort, and "no feedback" is the circuit breaker
(RFC 8083 asks for one). The gap in events is added for the operator: it measures the delay that a person can bear.
"""

from typing import Literal, NamedTuple

from lockstep.server.media.quality.path.event_gap import EventGap
from lockstep.server.media.quality.path.feedback_timeout import FeedbackTimeout
from lockstep.server.media.quality.path.loss_window import LossWindow
from lockstep.server.media.quality.path.round_trips import RoundTrips
from lockstep.server.media.quality.path.sending_rate import SendingRate
from lockstep.server.media.quality.path.standing_queue import StandingQueue

__all__ = ["BandwidthEstimator", "RateLimits", "Reason"]

Reason = Literal["", "no feedback", "round trip", "bandwidth", "gap", "loss"]

SILENT_STEP = 1.0  # s between two decreases in silence
REACTION = 0.5  # s on top of a round trip until a decrease shows
FRESH = 0.3  # s after a decrease until round trips show its effect
LOSS_EVERY = 2.0  # s
LATENESS = 0.3  # s
EPISODE = 4.0  # s; decreases that follow one another so closely belong to one queue
CALM = 1.0  # s without any sign of a limit before an increase
RAISE_EVERY = 1.0  # s
HIGH_LOSS, SOME_LOSS = 0.10, 0.02
FALL = 0.97  # an estimate below this share of the one before has fallen
MOST_PAUSE = 1.0  # s
START_GROWTH, FAR_GROWTH, NEAR_GROWTH = 1.35, 1.12, 1.04
NEAR_LIMIT = 0.85
USED = 0.7  # share of the rate that has to be sent for it to count as used
LIMIT_MEMORY = 60.0  # s that a limit is remembered


class RateLimits(NamedTuple):
    """The limits of a peer's rate, in bits per second of all its pictures together."""

    minimum: float
    start: float
    maximum: float


class BandwidthEstimator:
    """The rate of one peer's path. Call the inputs at any time and `decide` at regular intervals.

    `now` is on one monotonic clock.
    """

    def __init__(self, limits: RateLimits, now: float) -> None:
        self.limits = limits
        self.rate = limits.start
        self.reason: Reason = ""  # of the last decrease; "" when the rate is back at its maximum
        self.paused_until = 0.0  # no picture may leave before
        self.round_trips = RoundTrips()
        self.losses = LossWindow()
        self.gap = EventGap()
        self.sending = SendingRate()
        self.limited_at: float | None = None  # last time that the path showed a limit
        self._ceiling: float | None = None  # rate at that limit
        self._timeout = FeedbackTimeout(now)
        self._heard = False  # True after feedback since the last increase
        self._silent_from: float | None = None  # rate before the silence
        self._lowered_at = now - CALM
        self._raised_at = now
        self._sign_at = now - CALM  # of the last sign of a limit
        self._estimate: float | None = None
        self._estimate_fell = False
        self._queue = StandingQueue(self.round_trips)
        self._loss_floor: float | None = None
        self._late_at = float("-inf")

    # inputs

    def heard(self, now: float) -> None:
        """Note a sign of life of the peer."""
        if self._silent_from is not None:
            self.rate = max(self.rate, min(self.limits.maximum, self._silent_from / 2))
            self._silent_from = None
        self._timeout.restart(now)
        self._heard = True

    def received(self, lost: int, expected: int, round_trip: float | None, now: float) -> None:
        """Take a receiver report: packets since the last one, and the round trip in s if it contains one."""
        self.heard(now)
        self.losses.add(lost, expected, now)
        if round_trip is not None and now - self._late_at > LATENESS:
            self.round_trips.add(round_trip, now)

    def estimated(self, bitrate_bps: float, now: float) -> None:
        """Take the peer's own estimate of the bitrate that it can receive (REMB)."""
        self.heard(now)
        # aiortc gives its first estimate when it finds the path overused.
        before = self.sending.bps if self._estimate is None else self._estimate
        if bitrate_bps < FALL * before:
            self._estimate_fell = True
        self._estimate = bitrate_bps

    def lagged(self, lag: int, tolerance: int, now: float) -> None:
        """Take the largest gap of pictures since the last report, and the tolerance; both in events."""
        self.heard(now)
        self.gap.report(lag, tolerance)

    def late(self, now: float) -> None:
        """Note that this computer was busy: round trips measured now say nothing about the network."""
        self._late_at = self._sign_at = now

    # decisions

    def decide(self, now: float) -> None:
        """Apply the rules."""
        if self.sending.bps > 0 and self._timeout.is_over(self.round_trips.base, now):
            if self._silent_from is None:
                self._silent_from = self.rate
            if now - self._lowered_at >= SILENT_STEP:
                self._set(0.7 * self.rate, "no feedback", now)
        elif not self._lower(now):
            self._raise(now)
        if self.limited_at is not None and now - self.limited_at > LIMIT_MEMORY:
            self.limited_at = self._ceiling = None
        if self.rate >= self.limits.maximum:
            self.reason = ""

    @property
    def limited(self) -> bool:
        """True if the path showed a limit within the last minute."""
        return self.limited_at is not None

    def calm_for(self, now: float) -> float:
        """Seconds since the last sign of a limit."""
        return now - max(self._sign_at, self._lowered_at)

    def assume(self, rate: float, now: float) -> None:
        """Try a rate at which others are served."""
        self.rate = max(self.limits.minimum, rate)  # a peer without a camera needs nothing, and may get one
        self._raised_at = self._lowered_at = self._sign_at = now

    def _lower(self, now: float) -> bool:
        """Make the decrease that is due, if any; True if something speaks against an increase."""
        queued = self.round_trips.queued and self.round_trips.at > self._lowered_at + FRESH
        loss = self.losses.unusual(now)
        fell, self._estimate_fell = self._estimate_fell, False
        near = self.gap.is_near(now)
        queue_begins = self.round_trips.queue > self.round_trips.limit
        if not (queued or fell or near or loss > SOME_LOSS or queue_begins):
            self._loss_floor = None
            self._queue.gone()
            return False
        self._sign_at = now
        if now - self._lowered_at < self.round_trips.base + REACTION:
            self._estimate_fell = fell
            return True
        if queued:
            self._for_queue(now)
        elif fell and self._estimate is not None and (queue_begins or near or loss > SOME_LOSS):
            if self._estimate < self.rate:
                self._limit(self._estimate, "bandwidth", now)
        elif near:
            if self.gap.try_decrease(now):
                self._limit(0.8 * min(self.rate, max(self.sending.bps, 0.5 * self.rate)), "gap", now)
        elif loss > HIGH_LOSS and now - self._lowered_at >= LOSS_EVERY:
            self._loss_floor = self.rate / 2 if self._loss_floor is None else self._loss_floor
            if (wanted := self.rate * (1 - loss / 2)) > self._loss_floor:
                self._set(wanted, "loss", now)
        return True

    def _for_queue(self, now: float) -> None:
        trips, lossy = self.round_trips, self.losses.fraction(now) > SOME_LOSS
        self.paused_until = now + min(MOST_PAUSE, trips.queue)
        if not self._queue.try_decrease(recently=now - self._lowered_at < EPISODE, lossy=lossy):
            return
        carried = min(self.rate, self.sending.bps or self.rate) / (1 + trips.growth)
        # A rate that an undemanding picture left unused says little of the path, unless its queue grows or overflows.
        sure = trips.growth > 0.2 or lossy
        self._limit(max(0.85 * carried, (0.4 if sure else 0.65) * self.rate), "round trip", now)

    def _limit(self, rate: float, reason: Reason, now: float) -> None:
        """Lower the rate: the path carries no more than about `rate`."""
        self.limited_at = now
        if self._ceiling is None or now - self._lowered_at > EPISODE:
            self._ceiling = max(rate, min(self.rate, rate / 0.85))
        self._set(rate, reason, now)

    def _set(self, rate: float, reason: Reason, now: float) -> None:
        self.rate = max(self.limits.minimum, min(self.rate, rate))
        self.reason = reason
        self._lowered_at = now

    def _raise(self, now: float) -> None:
        """Increase the rate, if it is time: nothing speaks against it."""
        if not (
            self.rate < self.limits.maximum
            and self._heard
            and now - self._sign_at >= CALM
            and now - self._raised_at >= RAISE_EVERY
            and self.sending.bps >= USED * self.rate
        ):
            return
        if self._ceiling is None:
            growth = START_GROWTH
        else:
            growth = FAR_GROWTH if self.rate < NEAR_LIMIT * self._ceiling else NEAR_GROWTH
        self.rate = min(self.limits.maximum, growth * self.rate)
        self._raised_at = now
        self._heard = False
