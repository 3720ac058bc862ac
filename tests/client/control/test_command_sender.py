import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from lockstep.client.control.command_gate import CommandGate
from lockstep.client.control.command_sender import IDLE, TURN, CommandSender
from lockstep.client.control.resting import SETTLE
from lockstep.protocol.messages import Command, Feedback, Rest, StopState
from lockstep.protocol.pacing.repeat_timer import INITIAL
from lockstep.protocol.serial import MAX_EVENT, event_after
from tests.client.control.senders import FAST, NEUTRAL, commands, flying, new_sender, rests
from tests.makers import feedback, refusal


def test_an_intention_leaves_at_once_and_its_feedback_is_its_outcome() -> None:
    sender = new_sender(7)
    ticket = sender.intend(FAST, 0.0)
    assert sender.due(0.0) == [Command(event=8, issue=1, values=FAST)]
    assert sender.due(0.01) == []
    answer = feedback(8, at_rest=False)
    assert sender.feedback(answer, 0.03)
    assert [(each.ticket, each.feedback) for each in sender.outcomes()] == [(ticket, answer)]
    assert sender.outcomes() == []
    assert list(sender.retransmission.samples) == [0.03]


def test_before_the_first_feedback_nothing_leaves() -> None:
    sender = CommandSender(CommandGate("feedback", 4, 0.0), NEUTRAL)
    sender.intend(FAST, 0.0)
    assert sender.due(0.0) == []
    assert sender.wake_at(0.0) == float("inf")
    sender.feedback(feedback(1), 1.0)
    assert [command.event for command in commands(sender.due(1.0))] == [2]


def test_the_highest_event_rate_is_kept_and_waited_for() -> None:
    sender = new_sender(min_interval=0.04)
    flying(sender)
    sender.feedback(feedback(2), 0.01)
    sender.intend(FAST, 0.01)
    assert sender.due(0.01) == []
    assert sender.wake_at(0.01) == 0.04
    assert [command.event for command in commands(sender.due(0.04))] == [3]


def test_a_stick_that_is_let_go_does_not_wait_for_the_sound_that_its_command_makes_too_old() -> None:
    gate = CommandGate("feedback", 4, 0.016, calm_interval=0.04, sound_tolerance=4)
    sender = CommandSender(gate, NEUTRAL)
    sender.feedback(feedback(20), 0.0)
    flying(sender)
    sender.feedback(feedback(21, at_rest=False), 0.01)
    sender.gate.heard("microphone", 16, 0.01)
    sender.intend(FAST, 0.01)
    assert sender.wake_at(0.01) == 0.2
    assert sender.due(0.04) == []
    sender.intend(NEUTRAL, 0.04)
    assert sender.wake_at(0.03) == 0.04
    assert [command.values for command in commands(sender.due(0.04))] == [NEUTRAL]


def test_a_sender_that_waits_for_sound_wakes_when_none_has_been_heard_for_a_while() -> None:
    sender = CommandSender(CommandGate("media", 4, 0.0, sound_tolerance=4), NEUTRAL)
    sender.feedback(feedback(20), 0.0)
    sender.gate.shown(20)
    sender.gate.heard("microphone", 16, 0.0)
    sender.intend(FAST, 0.05)
    assert sender.due(0.05) == []
    assert sender.wake_at(0.05) == 0.2
    assert [command.event for command in commands(sender.due(0.2))] == [21]


def test_an_unanswered_command_is_repeated_with_the_newest_intention_and_the_newest_issue() -> None:
    sender = new_sender()
    flying(sender)
    assert sender.wake_at(0.0) == INITIAL
    sender.feedback(feedback(1, 2), 0.05)
    sender.intend([0.5], 0.06)
    assert sender.due(0.09) == []
    assert sender.due(INITIAL) == [Command(event=2, issue=2, values=[0.5])]
    assert sender.retransmission.repeats == 1


def test_an_intention_that_came_while_another_was_in_flight_gets_an_event_of_its_own() -> None:
    sender = new_sender()
    first = sender.intend(FAST, 0.0)
    sender.due(0.0)
    second = sender.intend([0.5], 0.01)
    sender.feedback(feedback(2), 0.02)
    assert [outcome.ticket for outcome in sender.outcomes()] == [first]
    assert sender.due(0.02) == [Command(event=3, issue=1, values=[0.5])]
    sender.feedback(feedback(3), 0.04)
    assert [outcome.ticket for outcome in sender.outcomes()] == [second]


def test_who_waited_long_for_an_answer_has_time_to_say_what_comes_next() -> None:
    sender = new_sender()
    flying(sender)
    sender.feedback(feedback(2), 3 * IDLE)
    assert sender.due(3 * IDLE) == []
    sender.intend([0.5], 3 * IDLE + 0.05)
    assert sender.due(3 * IDLE + 0.05) == [Command(event=3, issue=1, values=[0.5])]
    sender.feedback(feedback(3), 6 * IDLE)
    assert sender.due(6 * IDLE + TURN) == [Command(event=4, issue=1, values=NEUTRAL)]


def test_without_a_new_intention_neutral_values_leave_five_times_a_second() -> None:
    sender = new_sender()
    flying(sender)
    sender.feedback(feedback(2), 0.01)
    assert sender.wake_at(0.01) == IDLE
    assert sender.due(IDLE) == [Command(event=3, issue=1, values=NEUTRAL)]
    sender.feedback(feedback(3), IDLE + 0.01)
    assert sender.outcomes()[0].ticket == 1
    assert sender.wake_at(IDLE + 0.01) == 2 * IDLE
    assert [command.values for command in commands(sender.due(2 * IDLE))] == [NEUTRAL]


def test_not_armed_there_is_silence() -> None:
    sender = new_sender()
    assert sender.due(10.0) == []
    assert sender.wake_at(10.0) == float("inf")


def test_a_late_command_is_tried_again_on_fresh_feedback_only() -> None:
    sender = new_sender()
    flying(sender)
    sender.refusal(refusal(2, "late"))
    assert sender.due(0.1) == []
    assert sender.outcomes() == []
    sender.feedback(feedback(1, 2), 0.2)
    assert sender.due(0.2) == [Command(event=2, issue=2, values=FAST)]


def test_fresh_feedback_that_overtook_the_refusal_is_used() -> None:
    sender = new_sender()
    flying(sender)
    sender.feedback(feedback(1, 2), 0.05)
    sender.refusal(refusal(2, "late"))
    assert [command.issue for command in commands(sender.due(0.06))] == [2]


def test_a_refusal_that_time_cannot_cure_is_the_outcome_and_disarms() -> None:
    sender = new_sender()
    flying(sender)
    sender.refusal(refusal(2, "stopped"))
    [outcome] = sender.outcomes()
    assert outcome.refusal is not None
    assert outcome.refusal.reason == "stopped"
    assert not sender.armed
    assert sender.due(10.0) == []


def test_a_refusal_of_another_event_changes_nothing() -> None:
    sender = new_sender()
    flying(sender)
    sender.refusal(refusal(9, "stopped"))
    assert sender.outcomes() == []
    assert sender.armed


def test_a_refusal_without_an_event_is_of_the_one_in_flight() -> None:
    sender = new_sender()
    flying(sender)
    sender.refusal(refusal(0, "link_down"))
    [outcome] = sender.outcomes()
    assert outcome.refusal is not None
    assert outcome.refusal.reason == "link_down"


def test_an_event_voided_by_a_rest_is_used_up_by_a_neutral_command_first() -> None:
    sender = new_sender()
    ticket = sender.intend(FAST, 0.0)
    sender.due(0.0)
    sender.refusal(refusal(2, "rested"))
    assert sender.due(0.1) == [Command(event=2, issue=1, values=NEUTRAL)]
    sender.feedback(feedback(2), 0.12)
    assert sender.outcomes() == []
    assert sender.due(0.12) == [Command(event=3, issue=1, values=FAST)]
    sender.feedback(feedback(3), 0.14)
    assert [outcome.ticket for outcome in sender.outcomes()] == [ticket]


def test_arming_sends_one_neutral_command_and_is_done_with_its_feedback() -> None:
    sender = new_sender()
    sender.seat_changed(True)
    assert not sender.readiness.ready
    assert sender.due(0.0) == []
    ticket = sender.arm()
    assert [(each.event, each.values) for each in commands(sender.due(0.0))] == [(2, NEUTRAL)]
    assert [(each.event, each.values) for each in commands(sender.due(INITIAL))] == [(2, NEUTRAL)], "its repeat as well"
    sender.feedback(feedback(2), INITIAL)
    assert [each.ticket for each in sender.outcomes() if each.feedback is not None] == [ticket]
    assert (sender.readiness.ready, sender.armed) == (True, False), "nothing more leaves by itself"
    assert sender.due(10.0) == []


@pytest.mark.parametrize("what", ["arm", "drive"])
def test_an_event_that_somebody_else_executed_is_no_answer_to_a_command_without_the_seat(what: str) -> None:
    sender = new_sender()
    sender.seat_changed(False)
    sender.outcomes()
    ticket = sender.arm() if what == "arm" else sender.intend(FAST, 0.0)
    assert [each.event for each in commands(sender.due(0.0))] == [2]
    sender.feedback(feedback(2), 0.01)
    [outcome] = sender.outcomes()
    assert (outcome.ticket, outcome.feedback) == (ticket, None)
    assert outcome.refusal is not None
    assert outcome.refusal.reason == "no_seat"
    assert not sender.readiness.ready
    assert sender.due(10.0) == []


def test_whoever_loses_the_seat_hears_at_once_that_a_command_in_flight_was_not_taken() -> None:
    sender = new_sender()
    ticket = sender.intend(FAST, 0.0)
    sender.due(0.0)
    sender.seat_changed(False)
    assert [(each.ticket, each.refusal and each.refusal.reason) for each in sender.outcomes()] == [(ticket, "no_seat")]
    assert sender.due(10.0) == []


def test_arming_goes_on_over_a_refusal_that_fresh_feedback_cures_and_until_the_robot_asks_for_nothing_more() -> None:
    sender = new_sender()
    sender.seat_changed(True)
    sender.arm()
    sender.due(0.0)
    sender.refusal(refusal(2, "late"))
    sender.feedback(feedback(1, 2, neutral_needed=True), 0.01)
    assert [each.event for each in commands(sender.due(0.01))] == [2]
    sender.feedback(feedback(2, neutral_needed=True), 0.02)
    assert not sender.readiness.ready
    assert [each.event for each in commands(sender.due(0.02))] == [3]
    sender.feedback(feedback(3), 0.03)
    assert sender.readiness.ready


def _again(what: str) -> Feedback:
    """Feedback 1 measured again, after a stop, its reset, or something else."""
    stops = {"stopped": StopState(stopped=True, number=1), "reset": StopState(number=1), "asked": StopState()}
    return feedback(1, 2, stop=stops[what], neutral_needed=what == "asked")


@pytest.mark.parametrize("what", ["stopped", "reset", "asked"])
@pytest.mark.parametrize("doing", ["driving", "idle", "resting", "wanting"])
def test_after_a_stop_or_whatever_else_asks_for_it_nothing_leaves_by_itself_that_lets_the_robot_move(
    what: str, doing: str
) -> None:
    sender = new_sender()
    ticket = sender.intend(FAST, 0.0)
    if doing != "wanting":
        sender.due(0.0)
    if doing in ("idle", "resting"):
        sender.feedback(feedback(1, 1), 0.01)
        sender.intend(NEUTRAL, 0.01)
    sender.feedback(_again(what), 0.02)
    if doing == "resting":
        sender.rest(0.02)
    assert not sender.readiness.ready
    assert not sender.armed
    refused = [each for each in sender.outcomes() if each.refusal is not None]
    assert refused
    assert refused[-1].ticket >= ticket
    for now in (0.02, 0.1, 0.3, 1.0, 5.0):
        assert commands(sender.due(now)) == [], "neither a repeat, nor an idle command, nor one after a rest"
        sender.feedback(feedback(1, 3 + int(now)), now)
    sender.arm()
    assert [each.values for each in commands(sender.due(6.0))] == [NEUTRAL]


def test_what_is_wanted_while_the_robot_may_still_move_is_given_up_when_it_asks_for_a_neutral_command() -> None:
    """The neutral command that was under way when the robot asked does not let an intention of before it pass."""
    sender = new_sender()
    sender.arm()
    [neutral] = commands(sender.due(0.0))
    ticket = sender.intend(FAST, 0.01)
    sender.feedback(_again("asked"), 0.02)
    assert [(each.ticket, each.refusal.reason) for each in sender.outcomes() if each.refusal] == [
        (ticket, "not_neutral")
    ]
    sender.feedback(feedback(neutral.event), 0.03)  # it is executed after the robot asked
    assert not sender.readiness.ready
    assert commands(sender.due(1.0)) == []


def test_a_refusal_for_want_of_a_neutral_command_is_an_outcome_and_no_reason_to_send_one() -> None:
    sender = new_sender()
    flying(sender)
    sender.refusal(refusal(2, "not_neutral"))
    assert [each.refusal.reason for each in sender.outcomes() if each.refusal] == ["not_neutral"]
    assert sender.due(1.0) == []


def test_a_stop_ends_arming() -> None:
    sender = new_sender()
    sender.seat_changed(True)
    ticket = sender.arm()
    sender.feedback(_again("stopped"), 0.0)
    assert [(each.ticket, each.refusal.reason) for each in sender.outcomes() if each.refusal][-1] == (ticket, "stopped")
    assert sender.due(1.0) == []


def test_rest_leaves_at_once_past_the_shut_gate_and_names_the_event_in_flight() -> None:
    sender = new_sender()
    flying(sender)
    sender.rest(0.01)
    assert sender.due(0.01) == [Rest(event=2)]


def test_rest_disarms() -> None:
    sender = new_sender()
    flying(sender)
    sender.rest(0.01)
    assert not sender.armed


def test_rest_is_repeated_until_the_feedback_of_the_neutral_command_shows_it() -> None:
    sender = new_sender()
    flying(sender)
    sender.feedback(feedback(2, at_rest=False), 0.02)
    sender.rest(0.05)
    assert sender.due(0.05) == [Rest(event=2), Command(event=3, issue=1, values=NEUTRAL)]
    assert rests(sender.due(sender.wake_at(0.05))) == [Rest(event=2)]
    sender.feedback(feedback(2, 2, at_rest=True), 0.3)
    assert sender.resting
    sender.feedback(feedback(3, at_rest=False), 0.4)
    assert sender.resting
    sender.feedback(feedback(3, 2, at_rest=True), 0.5)
    assert (sender.resting, sender.due(100.0)) == (False, [])


def test_the_command_in_flight_repeats_with_neutral_values_after_a_rest() -> None:
    sender = new_sender()
    flying(sender)
    sender.rest(0.01)
    sender.due(0.01)
    assert [command.values for command in commands(sender.due(INITIAL + 0.01))] == [NEUTRAL]


def test_rest_of_a_robot_that_never_moved_is_said_once() -> None:
    sender = new_sender()
    sender.rest(0.0)
    assert sender.due(0.0) == [Rest(event=1)]
    assert not sender.resting
    assert sender.due(10.0) == []


def test_a_stopped_robot_at_rest_needs_no_further_proof() -> None:
    sender = new_sender()
    flying(sender)
    sender.rest(0.0)
    sender.due(0.0)
    sender.feedback(feedback(1, 2, stopped=True), 0.1)
    assert not sender.resting


def test_when_commands_are_refused_a_much_later_feedback_proves_the_rest() -> None:
    sender = new_sender()
    flying(sender)
    sender.rest(0.0)
    sender.due(0.0)
    sender.refusal(refusal(2, "no_seat"))
    sender.feedback(feedback(1, 2), 0.5 * SETTLE)
    assert sender.resting
    sender.feedback(feedback(1, 3), SETTLE)
    assert not sender.resting


def test_an_intention_that_a_rest_overtook_is_refused_as_rested() -> None:
    sender = new_sender(min_interval=1.0)
    flying(sender)
    sender.feedback(feedback(2), 0.01)
    sender.outcomes()
    ticket = sender.intend(FAST, 0.02)
    sender.due(0.02)
    sender.rest(0.03)
    [outcome] = sender.outcomes()
    assert outcome.refusal is not None
    assert (outcome.ticket, outcome.refusal.reason) == (ticket, "rested")


def test_a_flight_refused_as_rested_after_our_own_rest_is_an_outcome() -> None:
    sender = new_sender()
    flying(sender)
    sender.rest(0.01)
    sender.due(0.01)
    sender.refusal(refusal(2, "rested"))
    [outcome] = sender.outcomes()
    assert outcome.refusal is not None
    assert sender.due(0.02) == [Command(event=2, issue=1, values=NEUTRAL)]


def test_driving_again_ends_a_rest() -> None:
    sender = new_sender()
    flying(sender)
    sender.feedback(feedback(2, at_rest=False), 0.01)
    sender.rest(0.02)
    sender.due(0.02)
    sender.feedback(feedback(3, at_rest=False), 0.03)
    sender.intend(FAST, 0.04)
    assert not sender.resting
    assert sender.due(0.04) == [Command(event=4, issue=1, values=FAST)]


def test_media_pacing_waits_for_the_picture() -> None:
    sender = CommandSender(CommandGate("media", 0, 0.0), NEUTRAL)
    sender.feedback(feedback(5), 0.0)
    sender.intend(FAST, 0.0)
    assert sender.due(0.0) == []
    assert sender.wake_at(0.0) == float("inf")
    sender.gate.shown(5)
    assert len(sender.due(0.1)) == 1


class Robot(RuleBasedStateMachine):
    """A pilot against a bridge that executes exactly once, over a network that loses, doubles and delays."""

    def __init__(self) -> None:
        super().__init__()
        self.now = 0.0
        self.event = MAX_EVENT - 3
        self.executed: list[tuple[int, list[float | None]]] = []
        self.issue = 1
        self.sender = new_sender(self.event)
        self.network: list[Command] = []
        self.answers: list[tuple[int, int]] = []
        self.resting_since: int | None = None

    def step(self) -> None:
        for message in self.sender.due(self.now):
            if isinstance(message, Command):
                assert message.event == event_after(self.sender.newest.event if self.sender.newest else 0)
                self.network.append(message)
        assert self.sender.wake_at(self.now) > self.now

    @rule(speed=st.floats(0.1, 1.0))
    def intend(self, speed: float) -> None:
        self.sender.intend([speed], self.now)
        self.step()

    @rule()
    def rest(self) -> None:
        self.sender.rest(self.now)
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
            self.executed.append((command.event, list(command.values)))
        self.answers.append((self.event, self.issue))

    @rule()
    def refresh(self) -> None:
        self.issue += 1
        self.answers.append((self.event, self.issue))

    @precondition(lambda self: self.answers)
    @rule(data=st.data(), at_rest=st.booleans())
    def answer(self, data: st.DataObject, at_rest: bool) -> None:
        event, issue = self.answers.pop(data.draw(st.integers(0, len(self.answers) - 1)))
        self.sender.feedback(feedback(event, issue, at_rest=at_rest), self.now)
        self.step()

    @invariant()
    def nothing_executes_twice(self) -> None:
        events = [event for event, _ in self.executed]
        assert len(events) == len(set(events))

    @invariant()
    def disarmed_nothing_but_neutral_is_ever_sent_first(self) -> None:
        if not self.sender.armed:
            assert all(command.values == NEUTRAL for command in commands(self.sender.due(self.now)))


Robot.TestCase.settings = settings(max_examples=60, stateful_step_count=40, deadline=None)
TestPilotAgainstARobot = Robot.TestCase


class TestGoals:
    """Of a rate axis and a goal axis."""

    NEUTRAL = (0.5, None)

    def sender(self) -> CommandSender:
        sender = CommandSender(CommandGate("feedback", 4, 0.0), self.NEUTRAL)
        sender.feedback(feedback(1), 0.0)
        sender.readiness.ready = True
        return sender

    def test_a_command_and_its_repeats_carry_the_goals_and_the_speed(self) -> None:
        sender = self.sender()
        sender.intend([0.5, 1.0], 0.0, 0.25)
        assert sender.due(0.0) == [Command(event=2, issue=1, values=[0.5, 1.0], speed=0.25)]
        sender.intend([0.5, 1.5], 0.05, 0.75)
        assert sender.due(INITIAL) == [Command(event=2, issue=1, values=[0.5, 1.5], speed=0.75)]

    def test_a_goal_of_zero_moves_and_null_does_not(self) -> None:
        sender = self.sender()
        sender.intend([0.5, 0.0], 0.0)
        [moving] = commands(sender.due(0.0))
        assert not sender.intention.moves_nothing(moving)
        sender.feedback(feedback(2), 0.01)
        [idle] = commands(sender.due(IDLE + TURN))
        assert (idle.values, idle.speed) == (list(self.NEUTRAL), 1.0)
        assert sender.intention.moves_nothing(idle)

    def test_arming_and_resting_let_goal_axes_stay(self) -> None:
        sender = self.sender()
        sender.arm()
        [neutral] = commands(sender.due(0.0))
        assert neutral.values == list(self.NEUTRAL)
        sender.feedback(feedback(2), 0.01)
        sender.intend([0.5, 1.0], 0.02, 0.5)
        sender.due(0.02)
        sender.feedback(feedback(3, at_rest=False), 0.03)
        sender.rest(0.04)
        messages = sender.due(0.04)
        assert rests(messages)
        assert [(each.values, each.speed) for each in commands(messages)] == [(list(self.NEUTRAL), 1.0)]

    def test_a_jump_is_not_tried_again(self) -> None:
        sender = self.sender()
        sender.intend([0.5, 9.0], 0.0)
        sender.due(0.0)
        sender.refusal(refusal(2, "jump"))
        [outcome] = sender.outcomes()
        assert outcome.refusal is not None
        assert outcome.refusal.reason == "jump"
        assert sender.due(10.0) == []
        assert not sender.readiness.ready
