"""Who watches where: the console serves some itself, the rest go where the fewest are."""

from lockstep.server.sfu.assignment import PENDING_SECONDS, Assignment


def test_the_first_observers_are_served_directly_and_the_next_go_to_a_relay() -> None:
    handout = Assignment(2)
    assert handout.choose(0.0, 0, {"0": 0}) == ""
    assert handout.choose(0.0, 0, {"0": 0}) == ""
    assert handout.choose(0.0, 0, {"0": 0}) == "0"


def test_who_is_on_the_way_counts_until_it_is_there_or_does_not_come() -> None:
    handout = Assignment(1)
    handout.choose(0.0, 0, {"0": 0})
    assert handout.full(0.0, 0)
    assert not handout.full(PENDING_SECONDS, 0)
    assert handout.full(PENDING_SECONDS, 1)


def test_observers_go_where_the_fewest_are_with_those_on_the_way() -> None:
    handout = Assignment(0)
    assert [handout.choose(0.0, 0, {"0": 1, "1": 0}) for _ in range(3)] == ["1", "0", "1"]


def test_one_who_arrived_is_not_counted_twice() -> None:
    handout = Assignment(0)
    handout.choose(0.0, 0, {"0": 0, "1": 0})
    handout.arrived("0")
    assert handout.choose(0.0, 0, {"0": 1, "1": 1}) == "0"
    handout.arrived("0")
    assert not handout.expected(0.0)


def test_without_a_relay_everyone_is_served_directly() -> None:
    handout = Assignment(0)
    assert handout.choose(0.0, 300, {}) == ""


def test_a_relay_is_expected_to_be_needed_until_who_was_sent_there_is_late() -> None:
    handout = Assignment(0)
    handout.choose(0.0, 0, {"0": 0})
    assert handout.expected(PENDING_SECONDS - 1)
    assert not handout.expected(PENDING_SECONDS)
