"""Who gets sender reports when."""

from collections import Counter

from server.media.sender_reports import AT_ONCE, OFTEN, due


class Peer:
    def __init__(self, comes_first: bool = False) -> None:
        self.comes_first = comes_first

    def send_reports(self) -> None:
        raise AssertionError("only asked when it is due")


def test_up_to_fifty_observers_get_them_once_in_every_interval() -> None:
    peers = [Peer() for _ in range(AT_ONCE)]
    for interval in range(5):
        turns = [due(peers, turn) for turn in range(interval * OFTEN, (interval + 1) * OFTEN)]
        assert turns == [peers] + [[]] * (OFTEN - 1)
    assert due([], 1) == []


def test_of_more_each_has_its_turn_and_no_interval_has_more_than_fifty() -> None:
    peers = [Peer() for _ in range(4 * AT_ONCE - 7)]
    turns = [due(peers, turn) for turn in range(10 * OFTEN, 14 * OFTEN)]
    assert Counter(peer for each in turns for peer in each) == Counter(peers)
    assert max(len(turns[place]) for place in range(0, len(turns), OFTEN)) <= AT_ONCE
    assert sum(map(bool, turns)) == 4


def test_who_drives_or_may_gets_them_in_every_turn() -> None:
    operator = Peer(comes_first=True)
    peers = [*(Peer() for _ in range(200)), operator]
    assert all(due(peers, turn)[0] is operator for turn in range(8))
    assert all(due(peers, turn).count(operator) == 1 for turn in range(8))
