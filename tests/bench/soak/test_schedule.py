from collections import Counter

from hypothesis import example, given
from hypothesis import strategies as st

from lockstep.bench.soak.schedule import LAST_LIFE, LONGEST_CUT, counts_for, schedule


def test_half_an_hour_takes_five_kills_three_restarts_and_twenty_cuts() -> None:
    kinds = Counter(action.kind for action in schedule(30, 1))
    assert (kinds["kill_bridge"], kinds["restart_server"], kinds["cut_network"]) == (5, 3, 20)
    assert min(kinds["join"], kinds["leave"], kinds["stop"]) > 0


def test_two_minutes_take_at_least_one_of_each() -> None:
    assert min(counts_for(2)) == 1
    kinds = Counter(action.kind for action in schedule(2, 1))
    assert min(kinds["join"], kinds["leave"]) > 0


def test_the_same_seed_gives_the_same_plan_and_another_seed_another() -> None:
    assert schedule(30, 7) == schedule(30, 7)
    assert schedule(30, 7) != schedule(30, 8)


@given(st.floats(0.5, 120), st.integers(0, 1000))
@example(0.5, 8)  # as in make test
@example(1.0, 369)  # a long cut late in its slot
def test_actions_come_in_order_after_everybody_connected_and_before_the_end(minutes: float, seed: int) -> None:
    plan = schedule(minutes, seed)
    assert [action.at for action in plan] == sorted(action.at for action in plan)
    assert plan[0].at > 0
    assert all(action.at + action.seconds < minutes * 60 for action in plan if action.kind == "cut_network")
    assert all(action.seconds <= LONGEST_CUT for action in plan)
    restarts = [action.at for action in plan if action.kind == "restart_server"]
    assert max(restarts) <= minutes * 60 * LAST_LIFE
