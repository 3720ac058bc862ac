import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from lockstep.client.control.command_gate import CommandGate
from lockstep.client.control.command_sender import IDLE, TURN, CommandSender
from lockstep.client.control.repeat_timer import INITIAL
from lockstep.client.control.rest_call import SETTLE
from lockstep.protocol.messages import Command, Feedback, Rest, StopState
from lockstep.protocol.serial import MAX_EVENT, event_after
from tests.client.helpers import feedback, refusal
from tests.client.pilots import FAST, NEUTRAL, commands, flying, new_pilot, rests


def test_an_intention_leaves_at_once_and_its_feedback_is_its_outcome() -> None:
    pilot = new_pilot(7)
    ticket = pilot.intend(FAST, 0.0)
    assert pilot.due(0.0) == [Command(event=8, issue=1, values=FAST)]
    assert pilot.due(0.01) == []
    answer = feedback(8, at_rest=False)
    assert pilot.feedback(answer, 0.03)
    assert [(each.ticket, each.feedback) for each in pilot.outcomes()] == [(ticket, answer)]
    assert pilot.outcomes() == []
    assert list(pilot.samples) == [0.03]


def test_before_the_first_feedback_nothing_leaves() -> None:
    pilot = CommandSender(CommandGate("feedback", 4, 0.0), NEUTRAL)
    pilot.intend(FAST, 0.0)
    assert pilot.due(0.0) == []
    assert pilot.wake_at(0.0) == float("inf")
    pilot.feedback(feedback(1), 1.0)
    assert [command.event for command in commands(pilot.due(1.0))] == [2]


def test_the_highest_event_rate_is_kept_and_waited_for() -> None:
    pilot = new_pilot(min_interval=0.04)
    flying(pilot)
    pilot.feedback(feedback(2), 0.01)
    pilot.intend(FAST, 0.01)
    assert pilot.due(0.01) == []
    assert pilot.wake_at(0.01) == 0.04
    assert [command.event for command in commands(pilot.due(0.04))] == [3]


def test_an_unanswered_command_is_repeated_with_the_newest_intention_and_the_newest_issue() -> None:
    pilot = new_pilot()
    flying(pilot)
    assert pilot.wake_at(0.0) == INITIAL
    pilot.feedback(feedback(1, 2), 0.05)
    pilot.intend([0.5], 0.06)
    assert pilot.due(0.09) == []
    assert pilot.due(INITIAL) == [Command(event=2, issue=2, values=[0.5])]
    assert pilot.repeats == 1


def test_an_intention_that_came_while_another_was_in_flight_gets_an_event_of_its_own() -> None:
    pilot = new_pilot()
    first = pilot.intend(FAST, 0.0)
    pilot.due(0.0)
    second = pilot.intend([0.5], 0.01)
    pilot.feedback(feedback(2), 0.02)
    assert [outcome.ticket for outcome in pilot.outcomes()] == [first]
    assert pilot.due(0.02) == [Command(event=3, issue=1, values=[0.5])]
    pilot.feedback(feedback(3), 0.04)
    assert [outcome.ticket for outcome in pilot.outcomes()] == [second]


def test_who_waited_long_for_an_answer_has_time_to_say_what_comes_next() -> None:
    pilot = new_pilot()
    flying(pilot)
    pilot.feedback(feedback(2), 3 * IDLE)
    assert pilot.due(3 * IDLE) == []
    pilot.intend([0.5], 3 * IDLE + 0.05)
    assert pilot.due(3 * IDLE + 0.05) == [Command(event=3, issue=1, values=[0.5])]
    pilot.feedback(feedback(3), 6 * IDLE)
    assert pilot.due(6 * IDLE + TURN) == [Command(event=4, issue=1, values=NEUTRAL)]


def test_without_a_new_intention_neutral_values_leave_five_times_a_second() -> None:
    pilot = new_pilot()
    flying(pilot)
    pilot.feedback(feedback(2), 0.01)
    assert pilot.wake_at(0.01) == IDLE
    assert pilot.due(IDLE) == [Command(event=3, issue=1, values=NEUTRAL)]
    pilot.feedback(feedback(3), IDLE + 0.01)
    assert pilot.outcomes()[0].ticket == 1
    assert pilot.wake_at(IDLE + 0.01) == 2 * IDLE
    assert [command.values for command in commands(pilot.due(2 * IDLE))] == [NEUTRAL]


def test_not_armed_there_is_silence() -> None:
    pilot = new_pilot()
    assert pilot.due(10.0) == []
    assert pilot.wake_at(10.0) == float("inf")


def test_a_late_command_is_tried_again_on_fresh_feedback_only() -> None:
    pilot = new_pilot()
    flying(pilot)
    pilot.refusal(refusal(2, "late"))
    assert pilot.due(0.1) == []
    assert pilot.outcomes() == []
    pilot.feedback(feedback(1, 2), 0.2)
    assert pilot.due(0.2) == [Command(event=2, issue=2, values=FAST)]


def test_fresh_feedback_that_overtook_the_refusal_is_used() -> None:
    pilot = new_pilot()
    flying(pilot)
    pilot.feedback(feedback(1, 2), 0.05)
    pilot.refusal(refusal(2, "late"))
    assert [command.issue for command in commands(pilot.due(0.06))] == [2]


def test_a_refusal_that_time_cannot_cure_is_the_outcome_and_disarms() -> None:
    pilot = new_pilot()
    flying(pilot)
    pilot.refusal(refusal(2, "stopped"))
    [outcome] = pilot.outcomes()
    assert outcome.refusal is not None
    assert outcome.refusal.reason == "stopped"
    assert not pilot.armed
    assert pilot.due(10.0) == []


def test_a_refusal_of_another_event_changes_nothing() -> None:
    pilot = new_pilot()
    flying(pilot)
    pilot.refusal(refusal(9, "stopped"))
    assert pilot.outcomes() == []
    assert pilot.armed


def test_a_refusal_without_an_event_is_of_the_one_in_flight() -> None:
    pilot = new_pilot()
    flying(pilot)
    pilot.refusal(refusal(0, "link_down"))
    [outcome] = pilot.outcomes()
    assert outcome.refusal is not None
    assert outcome.refusal.reason == "link_down"


def test_an_event_voided_by_a_rest_is_used_up_by_a_neutral_command_first() -> None:
    pilot = new_pilot()
    ticket = pilot.intend(FAST, 0.0)
    pilot.due(0.0)
    pilot.refusal(refusal(2, "rested"))
    assert pilot.due(0.1) == [Command(event=2, issue=1, values=NEUTRAL)]
    pilot.feedback(feedback(2), 0.12)
    assert pilot.outcomes() == []
    assert pilot.due(0.12) == [Command(event=3, issue=1, values=FAST)]
    pilot.feedback(feedback(3), 0.14)
    assert [outcome.ticket for outcome in pilot.outcomes()] == [ticket]


def test_arming_sends_one_neutral_command_and_is_done_with_its_feedback() -> None:
    pilot = new_pilot()
    pilot.seated()
    assert not pilot.ready
    assert pilot.due(0.0) == []
    ticket = pilot.arm()
    assert [(each.event, each.values) for each in commands(pilot.due(0.0))] == [(2, NEUTRAL)]
    assert [(each.event, each.values) for each in commands(pilot.due(INITIAL))] == [(2, NEUTRAL)], "its repeat as well"
    pilot.feedback(feedback(2), INITIAL)
    assert [each.ticket for each in pilot.outcomes() if each.feedback is not None] == [ticket]
    assert (pilot.ready, pilot.armed) == (True, False), "nothing more leaves by itself"
    assert pilot.due(10.0) == []


@pytest.mark.parametrize("what", ["arm", "drive"])
def test_an_event_that_somebody_else_executed_is_no_answer_to_a_command_without_the_seat(what: str) -> None:
    pilot = new_pilot()
    pilot.unseated()
    pilot.outcomes()
    ticket = pilot.arm() if what == "arm" else pilot.intend(FAST, 0.0)
    assert [each.event for each in commands(pilot.due(0.0))] == [2]
    pilot.feedback(feedback(2), 0.01)
    [outcome] = pilot.outcomes()
    assert (outcome.ticket, outcome.feedback) == (ticket, None)
    assert outcome.refusal is not None
    assert outcome.refusal.reason == "no_seat"
    assert not pilot.ready
    assert pilot.due(10.0) == []


def test_whoever_loses_the_seat_hears_at_once_that_a_command_in_flight_was_not_taken() -> None:
    pilot = new_pilot()
    ticket = pilot.intend(FAST, 0.0)
    pilot.due(0.0)
    pilot.unseated()
    assert [(each.ticket, each.refusal and each.refusal.reason) for each in pilot.outcomes()] == [(ticket, "no_seat")]
    assert pilot.due(10.0) == []


def test_arming_goes_on_over_a_refusal_that_fresh_feedback_cures_and_until_the_robot_asks_for_nothing_more() -> None:
    pilot = new_pilot()
    pilot.seated()
    pilot.arm()
    pilot.due(0.0)
    pilot.refusal(refusal(2, "late"))
    pilot.feedback(feedback(1, 2, neutral_needed=True), 0.01)
    assert [each.event for each in commands(pilot.due(0.01))] == [2]
    pilot.feedback(feedback(2, neutral_needed=True), 0.02)
    assert not pilot.ready
    assert [each.event for each in commands(pilot.due(0.02))] == [3]
    pilot.feedback(feedback(3), 0.03)
    assert pilot.ready


def _again(what: str) -> Feedback:
    """Feedback 1 measured again, after a stop, its reset, or something else."""
    stops = {"stopped": StopState(stopped=True, number=1), "reset": StopState(number=1), "asked": StopState()}
    return feedback(1, 2, stop=stops[what], neutral_needed=what == "asked")


@pytest.mark.parametrize("what", ["stopped", "reset", "asked"])
@pytest.mark.parametrize("doing", ["driving", "idle", "resting", "wanting"])
def test_after_a_stop_or_whatever_else_asks_for_it_nothing_leaves_by_itself_that_lets_the_robot_move(
    what: str, doing: str
) -> None:
    pilot = new_pilot()
    ticket = pilot.intend(FAST, 0.0)
    if doing != "wanting":
        pilot.due(0.0)
    if doing in ("idle", "resting"):
        pilot.feedback(feedback(1, 1), 0.01)
        pilot.intend(NEUTRAL, 0.01)
    pilot.feedback(_again(what), 0.02)
    if doing == "resting":
        pilot.rest(0.02)
    assert not pilot.ready
    assert not pilot.armed
    refused = [each for each in pilot.outcomes() if each.refusal is not None]
    assert refused
    assert refused[-1].ticket >= ticket
    for now in (0.02, 0.1, 0.3, 1.0, 5.0):
        assert commands(pilot.due(now)) == [], "neither a repeat, nor an idle command, nor one after a rest"
        pilot.feedback(feedback(1, 3 + int(now)), now)
    pilot.arm()
    assert [each.values for each in commands(pilot.due(6.0))] == [NEUTRAL]


def test_a_refusal_for_want_of_a_neutral_command_is_an_outcome_and_no_reason_to_send_one() -> None:
    pilot = new_pilot()
    flying(pilot)
    pilot.refusal(refusal(2, "not_neutral"))
    assert [each.refusal.reason for each in pilot.outcomes() if each.refusal] == ["not_neutral"]
    assert pilot.due(1.0) == []


def test_a_stop_ends_arming() -> None:
    pilot = new_pilot()
    pilot.seated()
    ticket = pilot.arm()
    pilot.feedback(_again("stopped"), 0.0)
    assert [(each.ticket, each.refusal.reason) for each in pilot.outcomes() if each.refusal][-1] == (ticket, "stopped")
    assert pilot.due(1.0) == []


def test_rest_leaves_at_once_past_the_shut_gate_and_names_the_event_in_flight() -> None:
    pilot = new_pilot()
    flying(pilot)
    pilot.rest(0.01)
    assert pilot.due(0.01) == [Rest(event=2)]


def test_rest_disarms() -> None:
    pilot = new_pilot()
    flying(pilot)
    pilot.rest(0.01)
    assert not pilot.armed


def test_rest_is_repeated_until_the_feedback_of_the_neutral_command_shows_it() -> None:
    pilot = new_pilot()
    flying(pilot)
    pilot.feedback(feedback(2, at_rest=False), 0.02)
    pilot.rest(0.05)
    assert pilot.due(0.05) == [Rest(event=2), Command(event=3, issue=1, values=NEUTRAL)]
    assert rests(pilot.due(pilot.wake_at(0.05))) == [Rest(event=2)]
    pilot.feedback(feedback(2, 2, at_rest=True), 0.3)
    assert pilot.resting
    pilot.feedback(feedback(3, at_rest=False), 0.4)
    assert pilot.resting
    pilot.feedback(feedback(3, 2, at_rest=True), 0.5)
    assert (pilot.resting, pilot.due(100.0)) == (False, [])


def test_the_command_in_flight_repeats_with_neutral_values_after_a_rest() -> None:
    pilot = new_pilot()
    flying(pilot)
    pilot.rest(0.01)
    pilot.due(0.01)
    assert [command.values for command in commands(pilot.due(INITIAL + 0.01))] == [NEUTRAL]


def test_rest_of_a_robot_that_never_moved_is_said_once() -> None:
    pilot = new_pilot()
    pilot.rest(0.0)
    assert pilot.due(0.0) == [Rest(event=1)]
    assert not pilot.resting
    assert pilot.due(10.0) == []


def test_a_stopped_robot_at_rest_needs_no_further_proof() -> None:
    pilot = new_pilot()
    flying(pilot)
    pilot.rest(0.0)
    pilot.due(0.0)
    pilot.feedback(feedback(1, 2, stopped=True), 0.1)
    assert not pilot.resting


def test_when_commands_are_refused_a_much_later_feedback_proves_the_rest() -> None:
    pilot = new_pilot()
    flying(pilot)
    pilot.rest(0.0)
    pilot.due(0.0)
    pilot.refusal(refusal(2, "no_seat"))
    pilot.feedback(feedback(1, 2), 0.5 * SETTLE)
    assert pilot.resting
    pilot.feedback(feedback(1, 3), SETTLE)
    assert not pilot.resting


def test_an_intention_that_a_rest_overtook_is_refused_as_rested() -> None:
    pilot = new_pilot(min_interval=1.0)
    flying(pilot)
    pilot.feedback(feedback(2), 0.01)
    pilot.outcomes()
    ticket = pilot.intend(FAST, 0.02)
    pilot.due(0.02)
    pilot.rest(0.03)
    [outcome] = pilot.outcomes()
    assert outcome.refusal is not None
    assert (outcome.ticket, outcome.refusal.reason) == (ticket, "rested")


def test_a_flight_refused_as_rested_after_our_own_rest_is_an_outcome() -> None:
    pilot = new_pilot()
    flying(pilot)
    pilot.rest(0.01)
    pilot.due(0.01)
    pilot.refusal(refusal(2, "rested"))
    [outcome] = pilot.outcomes()
    assert outcome.refusal is not None
    assert pilot.due(0.02) == [Command(event=2, issue=1, values=NEUTRAL)]


def test_driving_again_ends_a_rest() -> None:
    pilot = new_pilot()
    flying(pilot)
    pilot.feedback(feedback(2, at_rest=False), 0.01)
    pilot.rest(0.02)
    pilot.due(0.02)
    pilot.feedback(feedback(3, at_rest=False), 0.03)
    pilot.intend(FAST, 0.04)
    assert not pilot.resting
    assert pilot.due(0.04) == [Command(event=4, issue=1, values=FAST)]


def test_media_pacing_waits_for_the_picture() -> None:
    pilot = CommandSender(CommandGate("media", 0, 0.0), NEUTRAL)
    pilot.feedback(feedback(5), 0.0)
    pilot.intend(FAST, 0.0)
    assert pilot.due(0.0) == []
    assert pilot.wake_at(0.0) == float("inf")
    pilot.shown(5)
    assert len(pilot.due(0.1)) == 1


class Robot(RuleBasedStateMachine):
    """A pilot against a bridge that executes exactly once, over a network that loses, doubles and delays."""

    def __init__(self) -> None:
        super().__init__()
        self.now = 0.0
        self.event = MAX_EVENT - 3
        self.executed: list[tuple[int, list[float]]] = []
        self.issue = 1
        self.pilot = new_pilot(self.event)
        self.network: list[Command] = []
        self.answers: list[tuple[int, int]] = []
        self.resting_since: int | None = None

    def step(self) -> None:
        for message in self.pilot.due(self.now):
            if isinstance(message, Command):
                assert message.event == event_after(self.pilot.newest.event if self.pilot.newest else 0)
                self.network.append(message)
        assert self.pilot.wake_at(self.now) > self.now

    @rule(speed=st.floats(0.1, 1.0))
    def intend(self, speed: float) -> None:
        self.pilot.intend([speed], self.now)
        self.step()

    @rule()
    def rest(self) -> None:
        self.pilot.rest(self.now)
        self.step()

    @rule(seconds=st.floats(0.001, 1.0))
    def wait(self, seconds: float) -> None:
        self.now += seconds
        self.step()

    @precondition(lambda self: self.network)
    @rule(data=st.data(), keep=st.booleans())
    def arrive(self, data: st.DataObject, keep: bool) -> None:
        index = data.draw(st.integers(0, len(self.network) - 1))
        command = self.network[index] if keep else self.network.pop(index)
        if command.event == event_after(self.event):
            self.event, self.issue = command.event, 1
            self.executed.append((command.event, command.values))
        self.answers.append((self.event, self.issue))

    @rule()
    def refresh(self) -> None:
        self.issue += 1
        self.answers.append((self.event, self.issue))

    @precondition(lambda self: self.answers)
    @rule(data=st.data(), at_rest=st.booleans())
    def answer(self, data: st.DataObject, at_rest: bool) -> None:
        event, issue = self.answers.pop(data.draw(st.integers(0, len(self.answers) - 1)))
        self.pilot.feedback(feedback(event, issue, at_rest=at_rest), self.now)
        self.step()

    @invariant()
    def nothing_executes_twice(self) -> None:
        events = [event for event, _ in self.executed]
        assert len(events) == len(set(events))

    @invariant()
    def disarmed_nothing_but_neutral_is_ever_sent_first(self) -> None:
        if not self.pilot.armed:
            assert all(command.values == NEUTRAL for command in commands(self.pilot.due(self.now)))


Robot.TestCase.settings = settings(max_examples=60, stateful_step_count=40, deadline=None)
TestPilotAgainstARobot = Robot.TestCase
