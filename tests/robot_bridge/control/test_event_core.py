import math

import pytest

from lockstep.protocol.messages import StopState
from lockstep.protocol.serial import MAX_EVENT, event_after
from lockstep.robot_bridge.control.event_core import (
    MAX_REMEMBERED_ISSUES,
    Absorbed,
    Answered,
    EventCore,
    Executed,
    Refused,
    draw_nonce,
)
from lockstep.robot_bridge.stop.stop_latch import ResetNeedless, ResetRefused, ResetTaken, StopGiven
from tests.robot_bridge.control.core_helpers import (
    AXES,
    MAX_AGE,
    MEASURED,
    NEUTRAL,
    NONCE,
    command,
    core_at,
    fresh_core,
    reason,
)

ANY_START = pytest.mark.parametrize("start", [1, 2, 1000, MAX_EVENT - 1, MAX_EVENT])


def test_the_first_feedback_is_event_1_issue_1_before_any_command() -> None:
    core = EventCore(AXES, max_event_age=MAX_AGE)
    assert core.feedback is None
    assert core.issue_due(0.0)
    feedback = core.issue(MEASURED, 5.0)
    assert (feedback.event, feedback.issue, feedback.time) == (1, 1, 5.0)
    assert core.feedback == feedback


@pytest.mark.parametrize("event", [0, -1, MAX_EVENT + 1])
def test_a_core_cannot_start_at_an_invalid_reference(event: int) -> None:
    with pytest.raises(ValueError, match="valid reference"):
        EventCore(AXES, max_event_age=MAX_AGE, first_event=event)


@ANY_START
def test_the_next_event_executes_and_its_feedback_makes_it_current(start: int) -> None:
    core = core_at(start)
    following = event_after(start)
    assert core.command(command(following), 100.0) == Executed(following, [0.5, 0.2])
    assert (core.current, core.pending) == (start, following)
    assert core.issue_due(100.0)
    feedback = core.issue(MEASURED, 100.004)
    assert (feedback.event, feedback.issue) == (following, 1)
    assert (core.current, core.pending) == (following, None)


@ANY_START
def test_a_repeat_of_the_pending_event_is_absorbed(start: int) -> None:
    core = core_at(start)
    following = event_after(start)
    core.command(command(following), 100.0)
    assert core.command(command(following, values=[-1.0, 0.3]), 100.0) == Absorbed(following)


@ANY_START
def test_a_repeat_of_the_current_event_gets_the_stored_feedback_again(start: int) -> None:
    core = core_at(start)
    following = event_after(start)
    core.command(command(following), 100.0)
    feedback = core.issue(MEASURED, 100.004)
    assert core.command(command(following), 100.1) == Answered(feedback)
    assert not core.issue_due(100.1)


@ANY_START
@pytest.mark.parametrize("offset", [-(2**29), -2, -1, 3, 10, 2**29])
def test_any_other_event_is_out_of_order(start: int, offset: int) -> None:
    event = (start + offset) % 2**31 or 4
    outcome = core_at(start).command(command(event), 100.0)
    assert isinstance(outcome, Refused)
    assert outcome.refusal.reason == "out_of_order"
    assert (outcome.refusal.event, outcome.refusal.current) == (event, start)


def test_the_event_after_the_pending_one_is_out_of_order() -> None:
    core = core_at()
    core.command(command(2), 100.0)
    assert reason(core.command(command(3), 100.0)) == "out_of_order"


@pytest.mark.parametrize(("age", "expected"), [(0.0, "executed"), (MAX_AGE, "executed"), (MAX_AGE + 0.001, "late")])
def test_a_command_may_answer_a_feedback_until_it_is_max_event_age_old(age: float, expected: str) -> None:
    assert reason(core_at().command(command(2), 100.0 + age)) == expected


def test_a_command_that_answers_an_unknown_issue_is_late() -> None:
    assert reason(core_at().command(command(2, issue=2), 100.0)) == "late"


def test_an_issue_of_the_event_before_does_not_count_for_this_one() -> None:
    core = core_at()
    core.issue(MEASURED, 100.1)
    core.command(command(2, issue=2), 100.2)
    core.issue(MEASURED, 100.2)
    assert reason(core.command(command(3, issue=2), 100.2)) == "late"


def test_a_late_refusal_is_followed_by_a_fresh_issue_that_can_be_answered() -> None:
    core = core_at()
    assert reason(core.command(command(2), 110.0)) == "late"
    assert core.issue_due(110.0)
    feedback = core.issue(MEASURED, 110.0)
    assert (feedback.event, feedback.issue) == (1, 2)
    assert reason(core.command(command(2, issue=2), 110.1)) == "executed"


def test_frozen_copies_of_a_command_never_execute_whatever_was_issued_meanwhile() -> None:
    core = core_at()
    for copy in range(5):
        now = 110.0 + copy * 0.01
        assert reason(core.command(command(2), now)) == "late"
        core.issue(MEASURED, now)
    assert core.pending is None


def test_an_older_issue_may_be_answered_while_it_is_young_enough() -> None:
    core = core_at()
    core.issue(MEASURED, 100.5)
    assert reason(core.command(command(2, issue=1), 101.0)) == "executed"


def test_a_flood_of_issues_forgets_the_oldest_first() -> None:
    core = core_at()
    for _ in range(MAX_REMEMBERED_ISSUES):
        core.issue(MEASURED, 100.0)
    assert reason(core.command(command(2, issue=1), 100.0)) == "late"
    assert reason(core.command(command(2, issue=2), 100.0)) == "executed"


def test_the_same_event_is_measured_again_twice_a_second() -> None:
    core = core_at(now=100.0)
    assert not core.issue_due(100.499)
    assert core.issue_due(100.5)
    assert core.issue(MEASURED, 100.5).issue == 2
    assert not core.issue_due(100.999)


def answered_at(core: EventCore, sent: list[float], until: float) -> list[float]:
    """When the commands that are sent at these times, or as soon as they may be, are answered."""
    now = sent[0]
    answers: list[float] = []
    while now < until:
        feedback = core.feedback
        assert feedback is not None
        if core.pending is None and len(answers) < len(sent) and now >= sent[len(answers)]:
            core.command(command(event_after(feedback.event), issue=feedback.issue, values=NEUTRAL), now)
        if core.issue_due(now) and core.issue(MEASURED, now).event != feedback.event:
            answers.append(now)
        now += 0.001
    return answers


def paced_core() -> EventCore:
    core = EventCore(AXES, max_event_age=MAX_AGE, max_event_rate=25.0, nonces=lambda: NONCE)
    core.issue(MEASURED, 100.0)
    return core


def test_a_burst_of_commands_is_answered_at_the_event_rate_and_none_is_refused() -> None:
    answers = answered_at(paced_core(), [100.0] * 20, 101.0)
    assert len(answers) == 20
    assert answers[2] - answers[0] < 0.01, "a few may come at once"
    assert all(when - answers[0] >= (number - 2) * 0.04 - 1e-6 for number, when in enumerate(answers))


def test_a_driver_that_keeps_the_event_rate_never_waits_however_its_commands_are_bunched() -> None:
    sent = [100.0 + 0.04 * (3 * (number // 3)) for number in range(20)]
    answers = answered_at(paced_core(), sent, 102.0)
    assert all(answer - when < 0.005 for answer, when in zip(answers, sent, strict=True))


def test_a_stop_is_fed_back_at_once_also_while_an_answer_waits() -> None:
    core, now = paced_core(), 100.0
    for event in range(2, 6):
        now += 0.001
        core.command(command(event, values=NEUTRAL), now)
        if core.issue_due(now):
            core.issue(MEASURED, now)
    assert core.pending == 5
    assert not core.issue_due(now + 0.001)
    core.stops.stop("", "Ada", "", now + 0.001)
    assert core.issue_due(now + 0.001)


def test_somebody_who_joins_gets_an_issue() -> None:
    core = core_at()
    core.want_issue()
    assert core.issue_due(100.0)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_value_that_is_not_a_number_is_refused(bad: float) -> None:
    assert reason(core_at().command(command(2, values=[0.0, bad]), 100.0)) == "not_a_number"


@pytest.mark.parametrize("values", [[], [0.0], [0.0, 0.2, 0.0]])
def test_anything_but_one_value_per_axis_is_refused(values: list[float]) -> None:
    assert reason(core_at().command(command(2, values=values), 100.0)) == "wrong_size"


def test_bad_values_are_refused_before_anything_else_is_said() -> None:
    core = core_at()
    core.stops.stop("", "Ada", "", 90.0)
    assert reason(core.command(command(2, values=[math.nan, 0.0]), 100.0)) == "not_a_number"
    assert reason(core.command(command(2, values=[]), 100.0)) == "wrong_size"


def test_while_stopped_every_command_is_refused_neutral_and_repeated_ones_too() -> None:
    core = core_at()
    core.stops.stop("", "Ada", "smoke", 90.0)
    for event, values in ((1, None), (2, None), (2, NEUTRAL), (7, None)):
        outcome = core.command(command(event, values=values), 100.0)
        assert isinstance(outcome, Refused)
        assert (outcome.refusal.reason, outcome.refusal.detail) == ("stopped", "smoke")


def test_the_stop_is_in_every_feedback_and_causes_one_at_once() -> None:
    core = core_at()
    core.stops.stop("ab12", "Ada", "smoke", 100.0)
    assert core.issue_due(100.0)
    told = core.issue(MEASURED, 100.0).stop
    assert told == StopState(stopped=True, by="Ada", reason="smoke", number=1, press="ab12", kept=False)
    assert core.stops.state == told


def test_a_second_stop_has_a_number_of_its_own_and_leaves_the_first_reason() -> None:
    core = core_at()
    assert core.stops.stop("", "Ada", "smoke", 100.0) == StopGiven(1, is_new=True, latched=True)
    core.issue(MEASURED, 100.0)
    assert core.stops.stop("", "Bob", "fire", 100.1) == StopGiven(2, is_new=True, latched=False)
    assert core.issue_due(100.1)
    assert (core.stops.state.by, core.stops.state.reason, core.stops.state.number) == ("Ada", "smoke", 2)


def test_a_repeat_of_a_press_changes_nothing() -> None:
    core = core_at()
    core.stops.stop("ab12", "Ada", "smoke", 100.0)
    core.issue(MEASURED, 100.0)
    assert core.stops.stop("ab12", "Ada", "smoke", 100.1) == StopGiven(1, is_new=False, latched=False)
    assert not core.issue_due(100.1)


def test_a_press_that_was_reset_is_a_repeat_until_the_robot_may_move_and_then_a_new_stop() -> None:
    core = core_at()
    core.stops.stop("ab12", "Ada", "", 100.0)
    core.issue(MEASURED, 100.0)
    core.stops.reset(1, 101.0)
    core.issue(MEASURED, 101.0)
    assert core.stops.stop("ab12", "Ada", "", 101.0) == StopGiven(1, is_new=False, latched=False)
    core.command(command(2, issue=3, values=NEUTRAL), 101.0)
    assert core.stops.stop("ab12", "Eve", "", 101.1) == StopGiven(2, is_new=True, latched=True)
    assert core.stops.stop("ab12", "Eve", "", 101.2) == StopGiven(2, is_new=False, latched=False)


def test_an_event_that_was_pending_at_the_stop_still_gets_its_feedback() -> None:
    core = core_at()
    core.command(command(2), 100.0)
    core.stops.stop("", "Ada", "", 100.0)
    feedback = core.issue(MEASURED, 100.0)
    assert (feedback.event, feedback.stop.stopped) == (2, True)


def test_reset_releases_the_stop_causes_an_issue_and_moves_nothing_before_a_neutral_command() -> None:
    core = core_at()
    core.stops.stop("", "Ada", "", 100.0)
    core.issue(MEASURED, 100.0)
    assert core.stops.reset(1, 101.0) == ResetTaken(1)
    assert core.issue_due(101.0)
    feedback = core.issue(MEASURED, 101.0)
    assert (feedback.stop.stopped, feedback.stop.number, feedback.neutral_needed) == (False, 1, True)
    assert reason(core.command(command(2, issue=3), 101.0)) == "not_neutral"
    assert reason(core.command(command(2, issue=3, values=NEUTRAL), 101.0)) == "executed"
    assert not core.issue(MEASURED, 101.0).neutral_needed
    assert reason(core.command(command(3), 101.0)) == "executed"


def test_a_stop_that_no_feedback_has_shown_cannot_be_reset() -> None:
    core = core_at()
    core.issue(MEASURED, 100.0)
    core.stops.stop("", "Ada", "", 100.0)
    outcome = core.stops.reset(1, 101.2)
    assert isinstance(outcome, ResetRefused)
    assert outcome.reason == "too_soon"
    core.issue(MEASURED, 101.2)
    assert core.stops.reset(1, 101.2) == ResetTaken(1)


@pytest.mark.parametrize("tick_first", [True, False])
def test_a_reset_that_waited_while_the_bridge_was_held_up_has_no_effect(tick_first: bool) -> None:
    core = core_at()
    core.stops.stop("", "Ada", "", 100.0)
    core.issue(MEASURED, 100.0)
    woken = 4000.0
    if tick_first:
        core.issue(MEASURED, woken)
    outcome = core.stops.reset(1, woken)
    assert isinstance(outcome, ResetRefused)
    assert outcome.reason == "too_soon"
    core.issue(MEASURED, woken)
    assert isinstance(core.stops.reset(1, woken + 0.9), ResetRefused)
    assert core.stops.reset(1, woken + 1.1) == ResetTaken(1)


def test_reset_without_a_stop_changes_nothing() -> None:
    core = core_at()
    assert core.stops.reset(0, 100.0) == ResetNeedless(0)
    assert not core.issue_due(100.0)


def test_a_robot_that_was_never_told_a_neutral_command_does_not_move() -> None:
    core = fresh_core()
    assert core.feedback is not None
    assert core.feedback.neutral_needed
    assert reason(core.command(command(2), 100.0)) == "not_neutral"
    assert core.pending is None


@pytest.mark.parametrize("cause", ["need_neutral", "lock_out", "let_in", "stop"])
def test_whatever_asks_for_a_neutral_command_is_fed_back_at_once(cause: str) -> None:
    core = core_at()
    if cause == "let_in":
        core.stops.lock_out("key switch", 100.0)
        core.issue(MEASURED, 100.0)
    match cause:
        case "need_neutral":
            core.interlock.require()
        case "lock_out":
            core.stops.lock_out("key switch", 100.0)
        case "let_in":
            core.stops.let_in()
        case _:
            core.stops.stop("", "Ada", "", 100.0)
    assert core.interlock.needed
    assert core.issue_due(100.0)
    assert core.issue(MEASURED, 100.0).neutral_needed


def test_a_neutral_command_decided_before_the_cause_executes_and_clears_nothing() -> None:
    core = core_at()
    core.interlock.require()
    assert reason(core.command(command(2, values=NEUTRAL), 100.0)) == "executed"
    assert core.issue(MEASURED, 100.0).neutral_needed
    assert reason(core.command(command(3, values=NEUTRAL), 100.0)) == "executed"
    assert not core.issue(MEASURED, 100.0).neutral_needed


def test_a_neutral_command_that_is_refused_clears_nothing() -> None:
    core = fresh_core()
    assert reason(core.command(command(3, values=NEUTRAL), 100.0)) == "out_of_order"
    assert reason(core.command(command(2, values=NEUTRAL), 110.0)) == "late"
    assert core.interlock.needed


@pytest.mark.parametrize("nonce", [0, NONCE + 1, 2**53 - 1])
def test_a_command_that_does_not_name_its_issues_nonce_is_refused_neutral_ones_too(nonce: int) -> None:
    core = core_at()
    assert reason(core.command(command(2, nonce=nonce), 100.0)) == "unseen"
    assert reason(core.command(command(2, nonce=nonce, values=NEUTRAL), 100.0)) == "unseen"


def test_the_nonce_belongs_to_the_issue_that_the_command_names() -> None:
    drawn = iter(range(1, 100))
    core = EventCore(AXES, max_event_age=MAX_AGE, nonces=lambda: next(drawn))
    first, second = core.issue(MEASURED, 100.0), core.issue(MEASURED, 100.1)
    assert (first.nonce, second.nonce) == (1, 2)
    assert reason(core.command(command(2, issue=1, nonce=2, values=NEUTRAL), 100.2)) == "unseen"
    assert reason(core.command(command(2, issue=1, nonce=1, values=NEUTRAL), 100.2)) == "executed"


def test_a_drawn_nonce_is_never_that_of_a_command_without_one() -> None:
    drawn = {draw_nonce() for _ in range(1000)}
    assert all(0 < each < 2**53 for each in drawn)
    assert len(drawn) == 1000, "nobody guesses the next one"
    assert max(drawn) > 2**52, "all bits are drawn"


def test_a_late_command_is_called_late_whatever_nonce_it_names() -> None:
    assert reason(core_at().command(command(2, nonce=0), 110.0)) == "late"


@ANY_START
def test_a_rest_that_names_the_next_event_voids_it_when_it_moves(start: int) -> None:
    core = core_at(start)
    following = event_after(start)
    assert core.rest(following)
    assert reason(core.command(command(following), 100.0)) == "rested"
    assert reason(core.command(command(following, values=NEUTRAL), 100.0)) == "executed"
    core.issue(MEASURED, 100.0)
    assert reason(core.command(command(event_after(following)), 100.0)) == "executed"


def test_a_rest_is_forgotten_once_its_event_executed_or_half_a_ring_later_it_would_void_again() -> None:
    core = core_at()
    core.rest(2)
    core.command(command(2, values=NEUTRAL), 100.0)
    core.issue(MEASURED, 100.0)
    core._current = 2**30 + 10  # as if so many events had passed
    core.issue(MEASURED, 100.0)
    assert reason(core.command(command(2**30 + 11, issue=2), 100.0)) == "executed"


@ANY_START
def test_an_older_rest_that_arrives_later_does_not_take_back_a_newer_one(start: int) -> None:
    core = core_at(start)
    core.rest(event_after(start))
    assert core.rest(start)
    assert reason(core.command(command(event_after(start)), 100.0)) == "rested"


@ANY_START
def test_a_rest_that_names_the_current_event_voids_nothing(start: int) -> None:
    core = core_at(start)
    assert core.rest(start)
    assert reason(core.command(command(event_after(start)), 100.0)) == "executed"


@ANY_START
def test_a_rest_that_names_an_older_event_than_the_executed_one_is_superseded(start: int) -> None:
    core = core_at(start)
    core.command(command(event_after(start)), 100.0)
    assert not core.rest(start)
    core.issue(MEASURED, 100.0)
    assert not core.rest(start)
    assert core.rest(event_after(start))


@ANY_START
@pytest.mark.parametrize("ahead", [5, 2**29, 2**30 - 1, 2**30])
def test_a_rest_far_ahead_rests_but_voids_no_more_than_the_next_event(start: int, ahead: int) -> None:
    core = core_at(start)
    following = event_after(start)
    assert core.rest((start + ahead) % 2**31 or 1)
    assert reason(core.command(command(following), 100.0)) == "rested"
    core.command(command(following, values=NEUTRAL), 100.0)
    core.issue(MEASURED, 100.0)
    assert reason(core.command(command(event_after(following)), 100.0)) == "executed"


def test_a_late_command_is_called_late_even_when_rested() -> None:
    core = core_at()
    core.rest(2)
    assert reason(core.command(command(2), 110.0)) == "late"


def test_a_refusal_names_the_current_event_and_cuts_long_details() -> None:
    refusal = core_at(41).refusal(0, "malformed", "x" * 600)
    assert (refusal.event, refusal.current, len(refusal.detail)) == (0, 41, 500)
