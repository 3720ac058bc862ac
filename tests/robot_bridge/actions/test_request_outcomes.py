"""What is remembered of requests for actions, and for how long."""

import msgspec

from lockstep.protocol.actions import ActionState, ActionUpdate
from lockstep.robot_bridge.actions.request_outcomes import MAX_REMEMBERED, TOLD_TO_NEWCOMERS, RequestOutcomes

AGE = 2.0


def update(id: str, state: ActionState = "refused") -> ActionUpdate:
    return ActionUpdate(id=id, name="home", state=state, event=1)


def full(state: ActionState = "refused") -> RequestOutcomes:
    outcomes = RequestOutcomes(AGE)
    for number in range(MAX_REMEMBERED):
        assert outcomes.make_room(10.0)
        outcomes.add(update(str(number), state), 10.0)
    return outcomes


def test_there_is_room_once_no_copy_of_the_oldest_request_can_arrive() -> None:
    outcomes = full()
    assert not outcomes.make_room(10.0 + AGE)
    assert outcomes.make_room(10.1 + AGE)
    assert "0" not in outcomes
    assert "1" in outcomes


def test_a_newer_update_leaves_the_time_and_the_place_of_its_request() -> None:
    outcomes = full()
    outcomes.replace(msgspec.structs.replace(outcomes["0"], text="news"))
    assert outcomes["0"].text == "news"
    assert outcomes.make_room(10.1 + AGE)
    assert "0" not in outcomes


def test_what_runs_is_never_forgotten() -> None:
    outcomes = full("running")
    assert not outcomes.make_room(1000.0)
    outcomes.replace(update("7", "done"))
    assert outcomes.make_room(1000.0)
    assert "7" not in outcomes


def test_a_newcomer_is_told_the_newest_and_all_that_run() -> None:
    outcomes = full()
    outcomes.replace(update("3", "running"))
    told = [each.id for each in outcomes.newest()]
    assert told == ["3", *map(str, range(MAX_REMEMBERED - TOLD_TO_NEWCOMERS, MAX_REMEMBERED))]
