import pytest

from lockstep.client.transport.ping_ledger import FORGOTTEN, LOST_AFTER, LOST_UNKNOWN, PingLedger


def test_a_pong_gives_the_round_trip() -> None:
    pings = PingLedger()
    number = pings.send(1.0)
    assert pings.answered(number, 1.25) == 0.25
    assert pings.round_trip == 0.25


def test_a_pong_that_answers_nothing_is_ignored() -> None:
    pings = PingLedger()
    number = pings.send(1.0)
    assert pings.answered(number + 1, 1.1) is None
    assert pings.round_trip is None


def test_a_ping_without_a_pong_is_lost_once() -> None:
    pings = PingLedger()
    pings.answered(pings.send(-1.0), -0.9)
    pings.send(0.0)
    pings.send(0.5)
    assert pings.lost(LOST_AFTER) == 0
    assert pings.lost(LOST_AFTER + 0.1) == 1
    assert pings.lost(LOST_AFTER + 0.1) == 0
    assert pings.lost(LOST_AFTER + 0.6) == 1


def test_on_a_long_path_a_ping_is_late_and_not_lost() -> None:
    pings = PingLedger()
    pings.answered(pings.send(0.0), 1.2)
    number = pings.send(2.0)
    assert pings.lost(4.3) == 0
    assert pings.lost(4.5) == 1
    assert pings.answered(number, 4.6) == pytest.approx(2.6), "its answer tells the round trip all the same"


def test_before_the_first_answer_nothing_is_lost_for_three_seconds() -> None:
    pings = PingLedger()
    number = pings.send(0.0)
    assert pings.lost(LOST_UNKNOWN) == 0
    assert pings.answered(number, LOST_UNKNOWN) == LOST_UNKNOWN


def test_no_ping_is_remembered_for_longer_than_its_answer_could_matter() -> None:
    pings = PingLedger()
    number = pings.send(0.0)
    assert pings.lost(FORGOTTEN + 0.1) == 1
    assert pings.answered(number, FORGOTTEN + 0.2) is None
