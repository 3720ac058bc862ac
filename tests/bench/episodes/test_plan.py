from collections import Counter
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.bench.episodes.plan import DRIVERS, POLICY, plan


@given(st.integers(1, 60), st.integers(0, 20), st.integers(0, 20), st.integers(0, 1000))
def test_as_many_are_discarded_and_redone_as_asked_for(times: int, discard: int, redo: int, seed: int) -> None:
    if discard + redo > times:
        with pytest.raises(ValueError, match="[Ss]ample"):
            plan(times, discard, redo, seed)
        return
    fates = Counter(each.fate for each in plan(times, discard, redo, seed))
    assert (fates["discard"], fates["redo"]) == (discard, redo)
    assert fates.total() == times


def test_two_people_and_a_policy_take_turns_and_some_episodes_change_hands() -> None:
    planned = plan(30, 6, 4, 1)
    assert [DRIVERS[each.turns[0]] for each in planned[:6]] == ["Ada", "Grace", "net", "Ada", "Grace", "net"]
    assert {each.fate for each in planned} == {"success", "failure", "discard", "redo"}
    by_people = [each for each in planned if POLICY not in each.turns]
    assert len(by_people) == 20
    assert sum(len(each.turns) == 2 for each in by_people) == 10
    assert all(each.person == each.turns[0] for each in by_people)


def test_among_thirty_episodes_each_way_to_correct_a_policy_is_kept_and_one_is_redone_or_discarded() -> None:
    with_policy = [each for each in plan(30, 6, 4, 1) if POLICY in each.turns]
    kept = {tuple(driver == POLICY for driver in each.turns) for each in with_policy if each.fate != "discard"}
    assert kept == {(True,), (True, False, True), (False, True, False, True), (True, False)}
    assert {"discard", "redo"} & {each.fate for each in with_policy}
    assert all(before != after for each in with_policy for before, after in pairwise(each.turns))
