from hypothesis import given
from hypothesis import strategies as st

from lockstep.robot_bridge.link.message_rate import MESSAGE_BYTES, MessageRate


def read(budget: MessageRate, size: int = 0) -> int:
    """How many messages of so many bytes may be read now."""
    count = 0
    while budget.left:
        budget.spend(size)
        count += 1
    return count


def test_a_burst_is_read_at_once_and_then_so_many_a_second() -> None:
    budget = MessageRate(100.0, 10.0, 0.0)
    assert read(budget) == 10
    assert read(budget) == 0
    budget.refill(0.05)
    assert read(budget) == 5
    budget.refill(3600.0)
    assert read(budget) == 10


def test_large_messages_count_as_many() -> None:
    budget = MessageRate(100.0, 10.0, 0.0)
    assert read(budget, 4 * MESSAGE_BYTES) == 2
    budget = MessageRate(100.0, 10.0, 0.0)
    assert read(budget, 1 << 20) == 1
    budget.refill(10.0)
    assert not budget.left, "it takes as long as a thousand small ones"
    budget.refill(10.3)
    assert budget.left


def test_what_it_says_to_wait_is_enough_for_some_messages_at_once() -> None:
    budget = MessageRate(100.0, 50.0, 0.0)
    assert budget.wait() == 0.0
    read(budget)
    budget.refill(budget.wait())
    assert read(budget) == 5


def test_a_clock_that_goes_back_takes_nothing_away() -> None:
    budget = MessageRate(100.0, 10.0, 5.0)
    budget.refill(0.0)
    assert read(budget) == 10


@given(st.lists(st.tuples(st.floats(0, 0.1), st.integers(0, 5000)), max_size=50))
def test_over_any_time_no_more_is_read_than_rate_and_burst_allow(steps: list[tuple[float, int]]) -> None:
    now, spent, largest = 0.0, 0.0, 0.0
    budget = MessageRate(100.0, 10.0, 0.0)
    for passed, size in steps:
        now += passed
        budget.refill(now)
        if budget.left:
            budget.spend(size)
            cost = 1 + size / MESSAGE_BYTES
            spent, largest = spent + cost, max(largest, cost)
    assert spent <= 10 + 100 * now + largest + 1e-6
