import pytest

from lockstep.server.control.seat.seat_times import COUNTDOWN, Heartbeat, IdleTime


@pytest.mark.parametrize(("round_trip", "patience"), [(0.0, 3.0), (0.6, 5.4), (60.0, 8.0)])
def test_on_a_long_path_silence_is_longer_by_four_round_trips_and_ends_all_the_same(
    round_trip: float, patience: float
) -> None:
    heartbeat = Heartbeat(3.0)
    heartbeat.heard(1.0, round_trip)
    assert not heartbeat.is_lost(1.0 + patience - 0.01)
    assert heartbeat.is_lost(1.0 + patience + 0.01)


def test_the_countdown_begins_once_and_ends_with_the_idle_time() -> None:
    idle = IdleTime(300.0)
    assert not idle.restart(10.0)
    begins = 310.0 - COUNTDOWN
    assert not idle.begins_countdown(begins - 0.1)
    assert idle.seconds_left(begins) is None
    assert idle.begins_countdown(begins)
    assert not idle.begins_countdown(begins + 1.0)
    assert idle.seconds_left(begins) == COUNTDOWN
    assert not idle.is_over(309.9)
    assert idle.is_over(310.0)
    assert idle.restart(310.0), "that ends the countdown"
    assert (idle.seconds_left(310.0), idle.is_over(310.0)) == (None, False)
