from lockstep.server.media.quality.path.loss_window import ENOUGH, LossWindow
from lockstep.server.media.quality.path.round_trips import LEAST_QUEUE, WINDOW, RoundTrips


def after(samples: list[float], step: float = 0.3) -> RoundTrips:
    trips = RoundTrips()
    for i, sample in enumerate(samples):
        trips.add(sample, i * step)
    return trips


def test_one_long_round_trip_is_no_queue() -> None:
    trips = after([0.04, 0.04, 0.04, 0.9])
    assert trips.queue == 0
    assert not trips.queued


def test_two_very_long_ones_are_and_three_long_ones_too() -> None:
    assert after([0.04, 0.04, 0.5, 0.6]).queued
    long = 0.04 + 1.5 * LEAST_QUEUE
    assert not after([0.04, 0.04, 0.04, long, long]).queued
    assert after([0.04, 0.04, 0.04, long, long, long]).queued


def test_a_queue_that_grows_says_how_fast() -> None:
    assert 0.4 < after([0.04, 0.19, 0.34, 0.49]).growth < 0.6
    assert after([0.5, 0.4, 0.3]).growth == 0


def test_a_path_that_varies_has_a_higher_limit() -> None:
    assert after([0.1, 0.2] * 40).limit > 2 * after([0.1, 0.1] * 40).limit


def test_a_route_that_became_longer_is_accepted_after_a_while() -> None:
    assert after([0.05] * 3 + [0.2] * int(2 * WINDOW / 0.3 + 10)).base == 0.2


def test_loss_of_few_packets_says_nothing() -> None:
    losses = LossWindow()
    losses.add(1, ENOUGH - 1, 0.0)
    assert losses.known
    assert losses.fraction(0.1) == 0
    losses.add(2, 21, 0.2)
    assert losses.fraction(0.3) == 3 / 50


def test_old_loss_is_forgotten_and_usual_loss_is_known() -> None:
    losses = LossWindow()
    for i in range(60):
        losses.add(5, 100, float(i))
    assert losses.unusual(60.0) == 0
    losses.add(60, 100, 60.0)
    assert losses.unusual(60.0) > 0.1
    assert losses.fraction(100.0) == 0
