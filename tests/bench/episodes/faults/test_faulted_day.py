"""What a day with faults keeps in mind of its episodes. The day itself is in test_run.py."""

from typing import Any, cast

from hypothesis import given
from hypothesis import strategies as st

from lockstep.bench.episodes.dataset import Kept
from lockstep.bench.episodes.faults.fault_run import FaultRun
from lockstep.bench.episodes.faults.faulted_day import Day, shares
from lockstep.bench.episodes.plan import plan
from lockstep.bench.episodes.session import Done


@given(st.integers(0, 40), st.integers(1, 9))
def test_the_episodes_are_shared_out_in_their_order_as_evenly_as_can_be(times: int, count: int) -> None:
    planned = plan(times, 0, 0, 1)
    found = shares(planned, count)
    assert [each for some in found for each in some] == planned
    assert len(found) == count
    assert max(map(len, found)) - min(map(len, found)) <= 1


def kept(episode: str) -> Kept:
    return Kept(episode, "success", 1, 9, (), "Ada")


def run(fault: str, *episodes: str, perhaps: tuple[str, ...] = (), wrong: tuple[str, ...] = ()) -> FaultRun:
    nothing = cast(Any, None)
    found = FaultRun(cast(Any, fault), nothing, nothing, nothing, nothing, nothing, "")
    found.kept, found.perhaps, found.wrong = (
        [kept(each) for each in episodes],
        [kept(each) for each in perhaps],
        [*wrong],
    )
    return found


def test_kept_episodes_are_in_the_order_in_which_they_were_driven_with_those_that_nobody_was_told_of() -> None:
    day = Day()
    day.add(
        [Done(1, "success", ["Ada"], kept=kept("a")), Done(2, "discard", ["Ada"])], run("kill-keeping", perhaps=("b",))
    )
    day.add([Done(3, "success", ["Ada"], kept=kept("c"))], run("camera-hangs", "d", wrong=("it never said so",)))
    assert [each.episode for each in day.kept] == ["a", "b", "c", "d"]
    assert [each.episode for each in day.told] == ["a", "c", "d"]
    assert [(each["fault"], each["ok"]) for each in day.faults] == [("kill-keeping", True), ("camera-hangs", False)]
    assert [each.number for each in day.done] == [1, 2, 3]
