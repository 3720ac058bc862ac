import pytest

from lockstep.server.media.quality.path.round_trips import RoundTrips
from lockstep.server.media.quality.path.standing_queue import TRIES, StandingQueue


def queued(seconds: float) -> RoundTrips:
    trips = RoundTrips()
    trips.add(0.04, 0.0)
    for number in range(1, 5):
        trips.add(0.04 + seconds, number / 3)
    return trips


def test_a_queue_that_decreases_do_not_shorten_is_a_longer_path_unless_packets_are_lost() -> None:
    trips = queued(0.3)
    queue = StandingQueue(trips)
    assert all(queue.try_decrease(recently=False, lossy=True) for _ in range(2 * TRIES))
    assert [queue.try_decrease(recently=False, lossy=False) for _ in range(TRIES + 1)] == [*[True] * TRIES, False]
    assert trips.base == pytest.approx(0.34)


def test_a_queue_that_drains_after_a_decrease_is_left_to_drain() -> None:
    trips = queued(0.3)
    queue = StandingQueue(trips)
    assert queue.try_decrease(recently=False, lossy=False)
    for number in range(5, 10):
        trips.add(0.04 + 0.1, number / 3)
    assert not queue.try_decrease(recently=True, lossy=False)
    assert queue.try_decrease(recently=False, lossy=False), "it is another queue"


def test_decreases_for_a_queue_that_is_gone_do_not_count() -> None:
    queue = StandingQueue(queued(0.3))
    for _ in range(TRIES):
        assert queue.try_decrease(recently=False, lossy=False)
    queue.gone()
    assert queue.try_decrease(recently=False, lossy=False)
