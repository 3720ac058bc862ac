import pytest

from lockstep.robot_bridge.link.heartbeats import MOST_SILENCE, PING_INTERVAL, PINGS_OUT, SILENCE, Heartbeats


def sent(heartbeats: Heartbeats, now: float) -> int:
    ping = heartbeats.ping(now)
    assert ping is not None
    return ping.id


def test_a_ping_is_due_at_each_interval_and_has_the_next_number() -> None:
    heartbeats = Heartbeats(10.0)
    assert heartbeats.ping(10.0 + 0.99 * PING_INTERVAL) is None
    assert sent(heartbeats, 10.25) == 1
    assert heartbeats.ping(10.3) is None
    assert sent(heartbeats, 10.5) == 2


def test_patience_grows_by_round_trips_and_has_an_end() -> None:
    heartbeats = Heartbeats(0.0)
    assert heartbeats.patience == SILENCE
    heartbeats.pong(sent(heartbeats, 1.0), 1.5)
    assert heartbeats.patience == SILENCE + 4 * 0.5
    heartbeats.measured(100.0)
    assert heartbeats.patience == MOST_SILENCE


def test_a_further_round_trip_counts_an_eighth() -> None:
    heartbeats = Heartbeats(0.0)
    heartbeats.measured(0.1)
    heartbeats.measured(0.5)
    assert heartbeats.patience == pytest.approx(SILENCE + 4 * 0.15)


def test_a_repeated_pong_and_one_to_a_forgotten_ping_count_for_nothing() -> None:
    heartbeats = Heartbeats(0.0)
    first = sent(heartbeats, 1.0)
    for number in range(PINGS_OUT):
        newest = sent(heartbeats, 2.0 + number)
    heartbeats.pong(first, 90.0)
    assert heartbeats.patience == SILENCE
    heartbeats.pong(newest, 2.0 + PINGS_OUT - 1 + 0.25)
    heartbeats.pong(newest, 90.0)
    assert heartbeats.patience == SILENCE + 4 * 0.25
