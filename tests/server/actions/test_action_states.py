"""Which updates are kept, and which are told later."""

from lockstep.protocol.actions import ActionState, ActionUpdate
from lockstep.server.actions.action_states import KEPT, ActionStates


def _update(id: str, state: ActionState = "done", age: float = 0.0) -> ActionUpdate:
    return ActionUpdate(id=id, name="home", state=state, event=7, age=age)


def test_an_action_that_has_ended_gets_older_and_one_that_runs_does_not() -> None:
    states = ActionStates()
    states.keep(_update("a", "running"), 100.0)
    states.keep(_update("b", age=5.0), 100.0)
    assert [(each.id, each.age) for each in states.newest(110.0)] == [("a", 0.0), ("b", 15.0)]
    states.keep(_update("b", age=99.0), 105.0)
    assert [each.age for each in states.newest(110.0)] == [0.0, 15.0], "it came to its state before"
    assert states.get("b") == _update("b")


def test_ends_that_nobody_is_told_of_are_not_kept() -> None:
    states = ActionStates()
    for number in range(1000):
        states.keep(_update(str(number)), 100.0)
    assert [each.id for each in states.newest(100.0)] == [str(number) for number in range(1000 - KEPT, 1000)]


def test_what_runs_and_what_is_told_later_is_kept_before_what_has_ended() -> None:
    states = ActionStates()
    states.keep(_update("runs", "running"), 100.0)
    states.owe(_update("owed"), 100.0)
    for number in range(KEPT):
        states.keep(_update(str(number)), 100.0)
    assert {"runs", "owed"} <= {each.id for each in states.newest(100.0)}
    for number in range(KEPT + 1):
        states.owe(_update(f"owed {number}"), 100.0)
    assert not states.owes("owed"), "they are bounded too"


def test_each_action_is_told_once_in_order_with_its_newest_update() -> None:
    states = ActionStates()
    states.owe(_update("a", "running"), 100.0)
    states.owe(_update("b"), 100.0)
    states.owe(_update("a"), 101.0)
    assert [states.take_owed(103.0).state, states.take_owed(103.0).id] == ["done", "b"]
    assert not states.is_owing
    states.owe(_update("a"), 100.0)
    states.clear()
    assert (states.is_owing, states.newest(103.0)) == (False, [])
