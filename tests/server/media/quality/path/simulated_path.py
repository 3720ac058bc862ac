"""A path with a drop-tail queue, in simulated time: what the controller does on it takes milliseconds to find out."""

import random
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

from lockstep.server.media.quality.path.bandwidth_estimator import BandwidthEstimator, RateLimits

STEP = 0.01  # s
DECIDE = 0.1
LIMITS = RateLimits(80_000, 300_000, 1_600_000)

Rate = Callable[[float], float]  # s -> bits per second


def steady(rate: float) -> Rate:
    return lambda now: rate


@dataclass
class SimulatedPath:
    """What is sent passes a bottleneck; reports come back as a receiver sends them."""

    capacity: Rate = field(default_factory=lambda: steady(10_000_000))
    base: float = 0.04  # s, round trip of the empty path
    room: float = 1.0  # s that the queue holds
    other: float = 200_000  # bits per second of sound, feedback and headers that share the path
    loss: float = 0.0  # besides what the queue drops
    spikes: float = 0.0  # share of round trips that a busy computer lengthens by 0.2 s
    jitter: float = 0.004  # s
    demand: float = 10_000_000  # bits per second that the pictures would use
    reports: Callable[[float], bool] = lambda now: True  # whether a report at that time gets through
    estimates: bool = True  # whether the receiver sends REMB
    lag: Callable[[float], int] | None = None  # what the client reports, with a tolerance of 4
    seed: int = 1
    limits: RateLimits = LIMITS

    def run(self, seconds: float) -> "Course":
        draw = random.Random(self.seed)
        path = BandwidthEstimator(self.limits, 0.0)
        course = Course(path)
        queue = octets = 0.0  # bits, bytes
        lost = expected = 0.0
        received: deque[float] = deque(maxlen=50)
        growing = 0
        estimate: float | None = None
        in_flight: deque[tuple[float, float]] = deque()  # round trips: when they come back, and how long they took
        for step in range(int(seconds / STEP)):
            now = step * STEP
            capacity = self.capacity(now)
            paused = now < path.paused_until
            video = 0.0 if paused else min(path.rate, self.demand)
            octets += video * STEP / 8
            before = queue
            arriving = (video + self.other) * STEP
            room = self.room * capacity
            dropped = max(0.0, queue + arriving - capacity * STEP - room)
            queue = max(0.0, queue + arriving - dropped - capacity * STEP)
            share = video / (video + self.other)
            expected += video * STEP / 8000
            lost += dropped * share / 8000 + self.loss * video * STEP / 8000
            received.append(video - dropped * share / STEP if queue == 0 else capacity * share)
            delay = queue / capacity if capacity > 0 else self.room
            growing = growing + 1 if queue > before and delay > 0.02 else 0
            if step % 33 == 0 and self.reports(now):
                spike = 0.2 if draw.random() < self.spikes else 0.0
                round_trip = self.base + delay + spike + draw.random() * self.jitter
                in_flight.append((now + round_trip, round_trip))
            while in_flight and in_flight[0][0] <= now:
                path.received(0, 0, in_flight.popleft()[1], now)
            if step % 100 == 50 and self.reports(now):
                path.received(round(lost), round(expected), None, now)
                lost = expected = 0.0
            if self.estimates and step % 20 == 0 and self.reports(now) and step > 100:
                rate = sum(received) / len(received)
                if growing > 20:
                    estimate = 0.85 * rate
                elif estimate is not None:
                    estimate = min(estimate * 1.016, max(estimate, 1.5 * rate + 10_000))
                if estimate is not None:
                    path.estimated(estimate, now)
            if self.lag is not None and step % 50 == 0 and self.reports(now):
                path.lagged(self.lag(now), 4, now)
            if step % int(DECIDE / STEP) == 0:
                path.sending.add(int(octets), now)
                path.decide(now)
                course.note(now, path.rate, delay, video, capacity)
        return course


@dataclass
class Course:
    """How it went, ten times a second."""

    path: BandwidthEstimator
    times: list[float] = field(default_factory=list)
    rates: list[float] = field(default_factory=list)
    queues: list[float] = field(default_factory=list)  # s
    sent: list[float] = field(default_factory=list)  # bits per second
    capacities: list[float] = field(default_factory=list)

    def note(self, now: float, rate: float, queue: float, sent: float, capacity: float) -> None:
        self.times.append(now)
        self.rates.append(rate)
        self.queues.append(queue)
        self.sent.append(sent)
        self.capacities.append(capacity)

    def after(self, seconds: float, series: list[float]) -> list[float]:
        return series[int(seconds / DECIDE) :]

    def mean_sent(self, after: float) -> float:
        values = self.after(after, self.sent)
        return sum(values) / len(values)

    def queue_share_above(self, limit: float, after: float) -> float:
        values = self.after(after, self.queues)
        return sum(value > limit for value in values) / len(values)
