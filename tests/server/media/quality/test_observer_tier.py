from lockstep.server.media.quality.observer_tier import MOST_PATIENCE, PATIENCE, ObserverTier
from lockstep.server.media.quality.path.bandwidth_estimator import BandwidthEstimator, RateLimits

HIGH = 1_000_000.0
LIMITS = RateLimits(80_000, HIGH, HIGH)


class Observer:
    """One whose path carries `capacity`."""

    def __init__(self, capacity: float) -> None:
        self.capacity = capacity
        self.path = BandwidthEstimator(LIMITS, 0.0)
        self.choice = ObserverTier(0.0)
        self.moves: list[tuple[float, str]] = []
        self._octets = 0.0
        self._queue = 0.0  # s

    def live(self, start: float, seconds: float) -> None:
        for step in range(int(seconds * 2)):
            now = start + step / 2
            tier = self.choice.tier
            sent = HIGH if tier == "high" else min(self.path.rate, HIGH / 2)
            self._octets += sent / 16
            self._queue = min(1.0, max(0.0, self._queue + (sent / self.capacity - 1) / 2))
            queue = self._queue
            for part in range(2):
                self.path.received(0, 20, 0.04 + queue, now + part / 4)
            self.path.sending.add(int(self._octets), now + 0.3)
            self.path.decide(now + 0.3)
            if self.choice.decide(self.path, HIGH, now + 0.3) != tier:
                self.moves.append((now, self.choice.tier))


def test_an_observer_on_a_good_path_stays_high() -> None:
    observer = Observer(capacity=2e6)
    observer.live(0.0, 120)
    assert observer.moves == []


def test_an_observer_on_a_narrow_path_goes_low_soon() -> None:
    observer = Observer(capacity=6e5)
    observer.live(0.0, 10)
    assert observer.choice.tier == "low"
    assert observer.moves[0][0] < 5


def test_trials_become_rarer() -> None:
    observer = Observer(capacity=6e5)
    observer.live(0.0, 600)
    trials = [at for at, tier in observer.moves if tier == "high"]
    waits = [later - earlier for earlier, later in zip(trials, trials[1:], strict=False)]
    assert 3 <= len(trials) <= 8
    assert waits == sorted(waits)
    assert waits[-1] > MOST_PATIENCE / 2


def test_an_observer_whose_path_got_better_goes_high_again() -> None:
    observer = Observer(capacity=6e5)
    observer.live(0.0, 9)
    observer.capacity = 2e6
    observer.live(9.0, 3 * PATIENCE)
    assert observer.choice.tier == "high"
