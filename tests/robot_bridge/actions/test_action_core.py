"""Which actions begin, and what ends them."""

import math

import pytest

from lockstep.protocol.actions import Act, ActionUpdate
from lockstep.protocol.description import Action, ActionParameter
from lockstep.protocol.messages import StopState
from lockstep.robot_bridge.actions.action_core import ActionCore, Begun, RobotNow
from lockstep.robot_bridge.actions.renewal import LONGEST
from lockstep.robot_bridge.actions.request_outcomes import MAX_REMEMBERED

HOLD = 0.3
AGE = 2.0
NONCE = 5
ACTIONS = (
    Action(name="home", label="Home"),
    Action(name="dock", label="Dock"),
    Action(
        name="light", label="Light", moves=False, parameters=(ActionParameter(name="on", label="On", kind="switch"),)
    ),
    Action(name="snapshot", label="Picture", moves=False),
)


def fresh(now: float = 0.0) -> ActionCore:
    core = ActionCore(ACTIONS, hold=HOLD, max_event_age=AGE)
    core.issued(NONCE, now)
    return core


def robot(now: float = 0.0, *, stop: StopState | None = None, neutral_needed: bool = False, **state: bool) -> RobotNow:
    at_rest = state.get("at_rest", True)
    return RobotNow(now, 7, stop or StopState(), neutral_needed, state.get("warns", False), at_rest)


def act(name: str = "home", id: str = "a", nonce: int = NONCE, **parameters: bool | float | str) -> Act:
    return Act(id=id, name=name, parameters=parameters, nonce=nonce)


def ask(core: ActionCore, request: Act, state: RobotNow | None = None) -> str:
    """The outcome of a request: "running", or why it was refused."""
    update = core.request(request, state or robot()).update
    return update.reason or update.state


def running(core: ActionCore) -> list[str]:
    return [each.id for each in core.outcomes.newest() if each.state == "running"]


def reasons(updates: list[ActionUpdate]) -> list[str]:
    return [f"{each.state} {each.reason}" for each in updates]


def test_a_request_begins_once_and_its_repeats_get_its_state() -> None:
    core = fresh()
    assert isinstance(core.request(act(), robot()), Begun)
    assert not isinstance(core.request(act(), robot()), Begun)
    core.finish("a", "done", 8, text="at home")
    repeated = core.request(act(), robot())
    assert not isinstance(repeated, Begun)
    assert (repeated.update.state, repeated.update.text, repeated.update.progress) == ("done", "at home", 1.0)


@pytest.mark.parametrize(
    ("request_", "state", "reason"),
    [
        (act("fly"), robot(), "unknown_action"),
        (act("light"), robot(), "bad_parameter"),
        (act("light", on=1.0), robot(), "bad_parameter"),
        (act("light", on=True, colour="red"), robot(), "bad_parameter"),
        (act(), robot(stop=StopState(stopped=True)), "stopped"),
        (act(), robot(stop=StopState(stopped=True, locked_out="key")), "locked_out"),
        (act("light", on=True), robot(stop=StopState(stopped=True)), "stopped"),
        (act(), robot(neutral_needed=True), "not_neutral"),
        (act(), robot(warns=True), "warning"),
        (act(), robot(at_rest=False), "driving"),
        (act(nonce=6), robot(), "late"),
        (act("light", nonce=0, on=True), robot(), "late"),
        (act(), robot(AGE + 0.1), "late"),
    ],
)
def test_a_request_that_must_not_begin_is_refused_by_name(request_: Act, state: RobotNow, reason: str) -> None:
    core = fresh()
    assert ask(core, request_, state) == reason
    assert running(core) == []


def test_an_action_that_moves_nothing_needs_no_neutral_command() -> None:
    core = fresh()
    assert ask(core, act("light", on=True), robot(neutral_needed=True, at_rest=False)) == "running"


def test_one_action_moves_the_robot_at_a_time_and_others_run_beside_it() -> None:
    core = fresh()
    assert ask(core, act("home", "a")) == "running"
    assert ask(core, act("dock", "b")) == "busy"
    assert ask(core, act("snapshot", "c")) == "running"
    assert ask(core, act("snapshot", "d")) == "busy"
    core.finish("a", "done", 8)
    assert ask(core, act("dock", "e")) == "running"


def test_a_copy_of_a_refused_request_never_begins() -> None:
    core = fresh()
    ask(core, act("home", "a"))
    assert ask(core, act("dock", "b")) == "busy"
    core.finish("a", "done", 8)
    assert ask(core, act("dock", "b")) == "busy"


def test_a_moving_action_lives_while_it_is_renewed_and_ends_after_hold() -> None:
    core = fresh()
    ask(core, act())
    now = 0.0
    for _ in range(10):
        now += 0.2
        assert core.look(robot(now)) == []
        assert core.renewed("a", now)
    assert core.look(robot(now + HOLD - 0.001)) == []
    assert reasons(core.look(robot(now + HOLD))) == ["cancelled not_renewed"]
    assert not core.renewed("a", now + HOLD)


def test_a_command_that_names_another_action_or_none_renews_nothing() -> None:
    core = fresh()
    ask(core, act())
    assert not core.renewed("", 0.2)
    assert not core.renewed("b", 0.2)
    assert reasons(core.look(robot(HOLD))) == ["cancelled not_renewed"]


def test_a_renewal_that_comes_after_hold_is_too_late() -> None:
    core = fresh()
    ask(core, act())
    assert not core.renewed("a", HOLD)
    assert reasons(core.look(robot(HOLD))) == ["cancelled not_renewed"]


def test_an_action_that_waits_goes_on_with_its_renewal_and_ends_after_two_seconds_without_one() -> None:
    core = fresh()
    ask(core, act())
    core.renewal.let_wait()
    assert not core.renewal.waits(HOLD - 0.001)
    assert core.renewal.waits(HOLD)
    now = 0.0
    for _ in range(5):
        now += 3 * HOLD
        assert core.look(robot(now)) == []
        assert core.renewed("a", now)
        assert not core.renewal.waits(now)
    assert core.look(robot(now + LONGEST - 0.001)) == []
    assert reasons(core.look(robot(now + LONGEST))) == ["cancelled not_renewed"]
    assert not core.renewed("a", now + LONGEST)
    assert core.moving == ""


def test_an_action_that_begins_does_not_wait_because_one_before_it_did() -> None:
    core = fresh()
    ask(core, act())
    core.renewal.let_wait()
    core.finish("a", "done", 8)
    assert ask(core, act("dock", "b")) == "running"
    assert not core.renewal.waits(HOLD)
    assert reasons(core.look(robot(HOLD))) == ["cancelled not_renewed"]


@pytest.mark.parametrize(
    ("state", "reason"),
    [
        (robot(2 * HOLD, stop=StopState(stopped=True)), "stopped"),
        (robot(2 * HOLD, stop=StopState(locked_out="by hand")), "locked_out"),
        (robot(2 * HOLD, neutral_needed=True), "interrupted"),
    ],
)
def test_what_ends_an_action_ends_one_that_waits(state: RobotNow, reason: str) -> None:
    core = fresh()
    ask(core, act())
    core.renewal.let_wait()
    assert core.renewal.waits(2 * HOLD)
    assert reasons(core.look(state)) == [f"cancelled {reason}"]
    assert not core.renewed("a", 2 * HOLD)


def test_an_action_that_moves_nothing_outlives_hold_and_a_stop() -> None:
    core = fresh()
    ask(core, act("snapshot"))
    assert core.look(robot(10 * HOLD, stop=StopState(stopped=True))) == []
    assert running(core) == ["a"]


@pytest.mark.parametrize(
    ("state", "reason"),
    [
        (robot(0.1, stop=StopState(stopped=True)), "stopped"),
        (robot(0.1, stop=StopState(stopped=True, locked_out="key")), "locked_out"),
        (robot(0.1, neutral_needed=True), "interrupted"),
    ],
)
def test_a_stop_a_lock_and_a_fault_cancel_the_moving_action(state: RobotNow, reason: str) -> None:
    core = fresh()
    ask(core, act())
    assert reasons(core.look(state)) == [f"cancelled {reason}"]
    assert core.moving == ""


def test_a_request_for_a_motion_from_before_a_rest_does_not_begin_after_it() -> None:
    core = fresh()
    core.interrupt("rested", 7)
    assert ask(core, act("snapshot", "s")) == "running"
    assert ask(core, act("home", "h")) == "late"
    core.issued(6, 0.1)
    assert ask(core, act("home", "i", nonce=6), robot(0.1)) == "running"


def test_cancel_without_an_id_ends_the_moving_action_alone() -> None:
    core = fresh()
    ask(core, act("home", "a"))
    ask(core, act("snapshot", "b"))
    assert reasons(core.cancel("", 8)) == ["cancelled cancelled"]
    assert running(core) == ["b"]
    assert reasons(core.cancel("b", 8)) == ["cancelled cancelled"]
    assert core.cancel("b", 8) == []


def test_progress_is_told_when_it_is_news_and_not_in_every_tick() -> None:
    core = fresh()
    ask(core, act())
    assert core.progress("a", 0.1, "", robot(0.05)) is None
    told = core.progress("a", 7.0, "nearly", robot(0.06))
    assert told is not None
    assert (told.progress, told.text) == (1.0, "nearly")
    assert core.progress("a", math.nan, "nearly", robot(0.4)) is None
    assert core.progress("z", 0.5, "", robot(0.4)) is None


def test_a_flood_of_requests_is_refused_and_none_of_them_can_begin_later() -> None:
    core = fresh()
    for number in range(MAX_REMEMBERED):
        ask(core, act("home" if number == 0 else "dock", f"n{number}"))
    assert ask(core, act("snapshot", "over")) == "too_often"
    core.finish("n0", "done", 8)
    later = robot(AGE + 0.1)
    core.issued(9, later.now)
    assert ask(core, act("snapshot", "over"), later) == "late"
    assert ask(core, act("snapshot", "new", nonce=9), later) == "running"


def test_newcomers_hear_of_all_that_runs_and_of_the_newest_others() -> None:
    core = fresh()
    ask(core, act("home", "first"))
    for number in range(40):
        ask(core, act("dock", f"n{number}"))
    newest = core.outcomes.newest()
    assert newest[0].id == "first"
    assert newest[-1].id == "n39"
    assert len(newest) == 17
