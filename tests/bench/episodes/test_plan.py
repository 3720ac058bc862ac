from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.bench.episodes.plan import plan


@given(st.integers(1, 60), st.integers(0, 20), st.integers(0, 20), st.integers(0, 1000))
def test_as_many_are_discarded_and_redone_as_asked_for(times: int, discard: int, redo: int, seed: int) -> None:
    if discard + redo > times:
        with pytest.raises(ValueError, match="[Ss]ample"):
            plan(times, discard, redo, seed)
        return
    fates = Counter(each.fate for each in plan(times, discard, redo, seed))
    assert (fates["discard"], fates["redo"]) == (discard, redo)
    assert fates.total() == times


def test_both_drivers_take_turns_and_some_episodes_change_hands_in_their_middle() -> None:
    planned = plan(30, 6, 4, 1)
    assert [each.driver for each in planned[:4]] == [0, 1, 0, 1]
    assert sum(each.shared for each in planned) == 6
    assert {each.fate for each in planned} == {"success", "failure", "discard", "redo"}
