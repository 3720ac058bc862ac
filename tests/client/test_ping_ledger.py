from client.ping_ledger import LOST_AFTER, PingLedger


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
    pings.send(0.0)
    pings.send(0.5)
    assert pings.lost(LOST_AFTER) == 0
    assert pings.lost(LOST_AFTER + 0.1) == 1
    assert pings.lost(LOST_AFTER + 0.1) == 0
    assert pings.lost(LOST_AFTER + 0.6) == 1
