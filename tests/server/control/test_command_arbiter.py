import math
from collections.abc import Sequence
from typing import Any

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from lockstep.protocol.description import Axis, RobotDescription
from lockstep.protocol.messages import Command, Feedback, Refusal, Rest, StopState, StopTaken
from lockstep.protocol.serial import MAX_EVENT, event_after
from lockstep.server.control.command_arbiter import (
    Absorbed,
    Answer,
    CommandArbiter,
    CommandOutcome,
    Forward,
    ForwardRest,
    Refuse,
    RestOutcome,
)
from lockstep.server.control.seat.control_seat import ControlSeat
from lockstep.server.control.seat.seat_rules import SeatRules
from lockstep.server.control.seat.seat_times import SeatTimes
from lockstep.server.event_clock import EventClock
from lockstep.server.stop.stop_presses import Press, StopPresses

ROBOT = RobotDescription(
    name="r",
    label="R",
    axes=tuple(Axis(name=name, label=name, unit="m/s", minimum=-1, maximum=2, slew=1, brake=1) for name in ("x", "y")),
)


def _feedback(event: int, issue: int = 1, *, stopped: bool = False, number: int = 0, neutral: bool = False) -> Feedback:
    return Feedback(
        event=event,
        issue=issue,
        time=0.0,
        axes=[0, 0],
        stop=StopState(stopped=stopped, number=number),
        nonce=1000 * event + issue,
        neutral_needed=neutral,
    )


def _command(
    event: int, values: Sequence[float | None] | None = None, *, issue: int = 1, nonce: int | None = None
) -> Command:
    """As an answer to the feedback before it, unless `nonce` is another one's."""
    before = event - 1 or MAX_EVENT
    return Command(
        event=event,
        issue=issue,
        values=[0.5, 0.5] if values is None else values,
        nonce=1000 * before + issue if nonce is None else nonce,
    )


class Bench:
    """A desk whose seat "me" holds, with the link up and feedback 7 at hand."""

    def __init__(self, *, held: bool = True, up: bool = True, stopped: bool = False) -> None:
        self.clock, self.seat, self.presses = EventClock(), ControlSeat(SeatTimes()), StopPresses()
        self.rules = SeatRules(self.seat)
        self.arbiter = CommandArbiter(self.clock, self.seat, self.presses)
        self.clock.begin("e")
        if held:
            self.rules.request("me", "operator", 0.0)
        if up:
            self.arbiter.robot_link_up(ROBOT)
            self.hear(_feedback(7, stopped=stopped))
        self.seat.neutral("me")

    def hear(self, feedback: Feedback) -> None:
        if self.clock.observe(feedback, 0.0):
            self.arbiter.feedback(feedback)


def _reason(outcome: CommandOutcome | RestOutcome) -> str:
    assert isinstance(outcome, Refuse)
    return outcome.refusal.reason


def test_the_next_command_passes_once_and_its_repeat_is_absorbed() -> None:
    bench = Bench()
    assert bench.arbiter.command("me", _command(8)) == Forward(_command(8))
    assert bench.arbiter.command("me", _command(8, [1.0, 1.0])) == Absorbed()
    bench.hear(_feedback(8))
    assert bench.arbiter.in_flight is None
    assert bench.arbiter.command("me", _command(8)) == Answer(_feedback(8))
    assert bench.arbiter.command("me", _command(9)) == Forward(_command(9))


NEUTRAL = [0.0, 0.0]


def test_a_new_holder_sends_a_neutral_command_before_a_moving_one() -> None:
    bench = Bench()
    bench.rules.take("next", "supervisor", 0.0)
    assert _reason(bench.arbiter.command("next", _command(8))) == "not_neutral"
    assert bench.arbiter.in_flight is None
    assert bench.arbiter.command("next", _command(8, NEUTRAL)) == Forward(_command(8, NEUTRAL))
    assert bench.arbiter.command("next", _command(8)) == Absorbed(), (
        "a repeat with a newer intention under the same event"
    )
    assert not bench.seat.may_move("next"), "it counts when it was executed"
    bench.hear(_feedback(8))
    assert bench.arbiter.command("next", _command(9)) == Forward(_command(9))
    bench.rules.take("last", "supervisor", 0.0)
    bench.rules.take("next", "supervisor", 0.0)
    bench.hear(_feedback(9))
    assert _reason(bench.arbiter.command("next", _command(10))) == "not_neutral", "also one who drove before"


def test_a_neutral_command_that_is_refused_proves_nothing() -> None:
    bench = Bench()
    bench.rules.take("next", "supervisor", 0.0)
    bench.arbiter.command("next", _command(20, NEUTRAL))
    bench.arbiter.command("other", _command(8, NEUTRAL))
    assert _reason(bench.arbiter.command("next", _command(8))) == "not_neutral"


def test_what_the_last_holder_executed_is_not_taken_for_the_new_ones() -> None:
    bench = Bench()
    bench.arbiter.command("me", _command(8))
    bench.rules.take("next", "supervisor", 0.0)
    bench.arbiter.abandon()
    assert _reason(bench.arbiter.command("next", _command(8, NEUTRAL))) == "out_of_order", "it is in flight still"
    bench.hear(_feedback(8))
    assert _reason(bench.arbiter.command("next", _command(8, NEUTRAL))) == "out_of_order", "it was the other's"
    assert bench.arbiter.command("next", _command(9, NEUTRAL)) == Forward(_command(9, NEUTRAL))


def test_a_repeat_after_the_link_was_lost_is_answered_if_it_was_executed() -> None:
    bench = Bench()
    bench.arbiter.command("me", _command(8))
    bench.arbiter.robot_link_down()
    bench.arbiter.robot_link_up(ROBOT)
    bench.hear(_feedback(8))
    assert bench.arbiter.command("me", _command(8)) == Answer(_feedback(8))
    bench.arbiter.epoch_ends()
    assert _reason(bench.arbiter.command("me", _command(8))) == "out_of_order", "references of another epoch"


def test_values_are_clamped_to_the_limits() -> None:
    outcome = Bench().arbiter.command("me", _command(8, [-5.0, 5.0]))
    assert outcome == Forward(_command(8, [-1.0, 2.0]))


@pytest.mark.parametrize(
    ("bench", "command", "reason"),
    [
        ({"held": False}, _command(8), "no_seat"),
        ({"up": False}, _command(8), "link_down"),
        ({}, _command(8, [0.0]), "wrong_size"),
        ({}, _command(8, [0.0, 0.0, 0.0]), "wrong_size"),
        ({}, _command(8, [math.nan, 0.0]), "not_a_number"),
        ({}, _command(8, [0.0, math.inf]), "not_a_number"),
        ({"stopped": True}, _command(8), "stopped"),
        ({}, _command(9), "out_of_order"),
        ({}, _command(6), "out_of_order"),
    ],
)
def test_a_command_that_may_not_pass_is_refused_with_the_reason(
    bench: dict[str, Any], command: Command, reason: str
) -> None:
    assert _reason(Bench(**bench).arbiter.command("me", command)) == reason


def test_a_link_without_feedback_yet_is_as_good_as_down() -> None:
    bench = Bench(up=False)
    bench.arbiter.robot_link_up(ROBOT)
    assert _reason(bench.arbiter.command("me", _command(8))) == "link_down"


def test_while_one_is_in_flight_no_other_event_passes() -> None:
    bench = Bench()
    bench.arbiter.command("me", _command(8))
    assert _reason(bench.arbiter.command("me", _command(9))) == "out_of_order"


def test_the_successor_wraps() -> None:
    bench = Bench(up=False)
    bench.arbiter.robot_link_up(ROBOT)
    bench.hear(_feedback(MAX_EVENT))
    assert bench.arbiter.command("me", _command(1, NEUTRAL)) == Forward(_command(1, NEUTRAL))
    bench.hear(_feedback(1))
    assert bench.arbiter.in_flight is None


def test_a_refusal_frees_the_way_and_goes_to_the_sender() -> None:
    bench = Bench()
    bench.arbiter.command("me", _command(8))
    assert bench.arbiter.refused(Refusal(event=8, reason="late", current=7)) == "me"
    assert bench.arbiter.command("me", _command(8)) == Forward(_command(8))


def test_a_refusal_of_something_else_goes_to_the_holder() -> None:
    bench = Bench()
    bench.arbiter.command("me", _command(8))
    assert bench.arbiter.refused(Refusal(event=5, reason="late", current=7)) == "me"
    assert bench.arbiter.in_flight is not None
    bench.rules.release("me", 0.0)
    assert bench.arbiter.refused(Refusal(event=5, reason="late", current=7)) == ""


def test_what_was_in_flight_is_forgotten_with_the_link() -> None:
    bench = Bench()
    bench.arbiter.command("me", _command(8))
    bench.arbiter.robot_link_down()
    assert _reason(bench.arbiter.command("me", _command(8))) == "link_down"
    bench.arbiter.robot_link_up(ROBOT)
    assert bench.arbiter.command("me", _command(8, NEUTRAL)) == Forward(_command(8, NEUTRAL))


def test_a_rest_of_the_holder_passes_and_repeats_wait_for_an_answer() -> None:
    bench = Bench()
    assert bench.arbiter.rest("me", Rest(event=8)) == ForwardRest(Rest(event=8))
    assert bench.arbiter.rest("me", Rest(event=8)) == Absorbed()
    assert bench.arbiter.rest("me", Rest(event=7)) == ForwardRest(Rest(event=7))
    bench.hear(_feedback(7, 2))
    assert bench.arbiter.rest("me", Rest(event=7)) == ForwardRest(Rest(event=7))


def test_a_rest_passes_while_a_command_is_in_flight_and_while_stopped() -> None:
    bench = Bench(stopped=True)
    assert bench.arbiter.rest("me", Rest(event=8)) == ForwardRest(Rest(event=8))
    bench = Bench()
    bench.arbiter.command("me", _command(8))
    assert bench.arbiter.rest("me", Rest(event=8)) == ForwardRest(Rest(event=8))


def test_a_rest_after_a_command_passes_though_the_same_was_said_before_it() -> None:
    bench = Bench()
    assert bench.arbiter.abandon() == ForwardRest(Rest(event=8))
    bench.arbiter.command("me", _command(8, NEUTRAL))
    assert bench.arbiter.abandon() == ForwardRest(Rest(event=8))


def test_a_rest_that_names_a_far_event_names_the_next_instead() -> None:
    assert Bench().arbiter.rest("me", Rest(event=1000)) == ForwardRest(Rest(event=8))


def test_others_cannot_rest_the_robot() -> None:
    assert _reason(Bench().arbiter.rest("other", Rest(event=8))) == "no_seat"
    assert _reason(Bench(up=False).arbiter.rest("me", Rest(event=8))) == "link_down"


def test_when_the_holder_is_gone_the_next_event_is_void_too() -> None:
    bench = Bench()
    bench.arbiter.command("me", _command(8))
    bench.rules.gone("me", 0.0)
    assert bench.arbiter.abandon() == ForwardRest(Rest(event=8))


def test_a_stop_on_its_way_refuses_commands_until_a_feedback_has_shown_it_and_its_reset() -> None:
    bench = Bench()
    bench.presses.press(Press(id="p"))
    assert _reason(bench.arbiter.command("me", _command(8))) == "stopped"
    bench.hear(_feedback(7, 2))  # issued before the stop arrived
    assert _reason(bench.arbiter.command("me", _command(8, issue=2))) == "stopped"
    taken = StopTaken(press="p", number=1)
    bench.presses.taken(taken)
    bench.arbiter.stop_taken(taken)
    assert _reason(bench.arbiter.command("me", _command(8, issue=2))) == "stopped", "taken, and not shown yet"
    bench.hear(_feedback(7, 3, stopped=True, number=1))
    bench.hear(_feedback(7, 4, number=1))  # and reset
    assert _reason(bench.arbiter.command("me", _command(8, issue=4))) == "not_neutral"
    assert isinstance(bench.arbiter.command("me", _command(8, NEUTRAL, issue=4)), Forward)


def test_a_stop_and_its_reset_that_no_feedback_showed_apart_ask_for_a_neutral_command_too() -> None:
    bench = Bench()
    bench.hear(_feedback(7, 2, number=1))
    assert _reason(bench.arbiter.command("me", _command(8, issue=2))) == "not_neutral"


@pytest.mark.parametrize("what", ["stop", "link", "epoch", "robot"])
def test_after_a_stop_a_new_link_a_new_epoch_and_when_the_robot_says_so_a_neutral_command_comes_first(
    what: str,
) -> None:
    bench = Bench()
    bench.arbiter.command("me", _command(8))
    bench.hear(_feedback(8))
    if what == "stop":
        bench.hear(_feedback(8, 2, stopped=True, number=1))
        bench.hear(_feedback(8, 3, number=1))
    elif what == "link":
        bench.arbiter.robot_link_down()
        bench.arbiter.robot_link_up(ROBOT)
        bench.hear(_feedback(8, 3))
    elif what == "epoch":
        bench.arbiter.robot_link_down()
        bench.arbiter.epoch_ends()
        bench.clock.begin("another")
        bench.arbiter.robot_link_up(ROBOT)
        bench.hear(_feedback(8, 3))
    else:
        bench.hear(_feedback(8, 3, neutral=True))
    assert _reason(bench.arbiter.command("me", _command(9, issue=3))) == "not_neutral"
    assert isinstance(bench.arbiter.command("me", _command(9, NEUTRAL, issue=3)), Forward)
    bench.hear(_feedback(9))
    assert bench.arbiter.command("me", _command(10)) == Forward(_command(10))


def test_a_neutral_command_proves_nothing_while_the_robot_still_asks_for_one() -> None:
    bench = Bench()
    bench.hear(_feedback(7, 2, neutral=True))
    bench.arbiter.command("me", _command(8, NEUTRAL, issue=2))
    bench.hear(_feedback(7, 3, neutral=True))  # issued before the command arrived
    bench.hear(_feedback(8, neutral=True))
    assert _reason(bench.arbiter.command("me", _command(9))) == "not_neutral"


def test_a_neutral_command_of_before_the_seat_was_given_up_proves_nothing_after_it() -> None:
    bench = Bench()
    bench.seat.neutral_needed()
    bench.arbiter.command("me", _command(8, NEUTRAL))
    bench.rules.release("me", 0.0)
    bench.arbiter.abandon()
    bench.rules.request("me", "operator", 0.0)
    bench.hear(_feedback(8))
    assert _reason(bench.arbiter.command("me", _command(9))) == "not_neutral"


def test_a_command_that_does_not_name_the_nonce_of_the_issue_it_answers_is_unseen() -> None:
    bench = Bench()
    assert _reason(bench.arbiter.command("me", _command(8, nonce=7002))) == "unseen"
    assert _reason(bench.arbiter.command("me", _command(8, nonce=0))) == "unseen"
    bench.hear(_feedback(7, 2))
    assert _reason(bench.arbiter.command("me", _command(8, issue=2, nonce=7001))) == "unseen", "that of another issue"
    assert isinstance(bench.arbiter.command("me", _command(8)), Forward), "an earlier issue, with its own"


def test_an_issue_that_nobody_knows_is_late() -> None:
    bench = Bench()
    for issue in range(2, 100):
        bench.hear(_feedback(7, issue))
    assert _reason(bench.arbiter.command("me", _command(8, issue=2))) == "late"
    assert _reason(bench.arbiter.command("me", _command(8, issue=500))) == "late"
    assert isinstance(bench.arbiter.command("me", _command(8, issue=99)), Forward)


class DeskMachine(RuleBasedStateMachine):
    """Peers, a bridge that behaves as promised, a link that breaks: in any order."""

    peers = st.sampled_from(["a", "b", "c"])

    @initialize(event=st.sampled_from([1, 2, MAX_EVENT - 2, MAX_EVENT]))
    def start(self, event: int) -> None:
        self.clock, self.seat = EventClock(), ControlSeat(SeatTimes())
        self.seat_rules = SeatRules(self.seat)
        self.presses = StopPresses()
        self.arbiter = CommandArbiter(self.clock, self.seat, self.presses)
        self.up = self.stopped = False
        self.event, self.issue, self.number, self.pressed = event, 1, 0, 0
        self.proven = ""  # the peer whose neutral command the bridge has executed since the newest reason for one
        self.on_the_way: list[Command] = []  # forwarded, not yet seen by the bridge

    @rule()
    def robot_link_up(self) -> None:
        self.arbiter.robot_link_up(ROBOT)
        self.up, self.proven = True, ""
        self.on_the_way = []
        self.bridge_issues()

    @rule()
    def robot_link_down(self) -> None:
        self.arbiter.robot_link_down()
        self.up, self.on_the_way = False, []

    @rule(peer=peers, operator=st.booleans())
    def request(self, peer: str, operator: bool) -> None:
        self.seat_rules.request(peer, "operator" if operator else "observer", 0.0)

    @rule(peer=peers)
    def leave(self, peer: str) -> None:
        if self.seat_rules.gone(peer, 0.0).rest:
            self.arbiter.abandon()
            self.proven = ""

    @rule(
        peer=peers,
        offset=st.integers(-1, 2),
        values=st.lists(st.floats() | st.just(0.0) | st.none(), min_size=1, max_size=3),
        seen=st.booleans(),
    )
    def command(self, peer: str, offset: int, values: list[float | None], seen: bool) -> None:
        named = (self.event + offset - 1) % MAX_EVENT + 1
        known_stop = self.clock.stop.stopped or bool(self.presses.pending)
        nonce = 1000 * self.event + self.issue + (not seen)
        command = Command(event=named, issue=self.issue, values=values, nonce=nonce)
        outcome = self.arbiter.command(peer, command)
        if isinstance(outcome, Forward):
            assert self.seat.holder == peer
            assert self.up
            assert seen
            assert not known_stop
            assert not self.on_the_way
            assert outcome.command.event == event_after(self.clock.event)
            assert all(value is not None and -1 <= value <= 2 for value in outcome.command.values)
            assert outcome.command.values == NEUTRAL or self.proven == peer
            self.on_the_way.append(outcome.command)

    @rule(peer=peers)
    def rest(self, peer: str) -> None:
        if isinstance(self.arbiter.rest(peer, Rest(event=self.event)), ForwardRest):
            assert self.seat.holder == peer

    @rule()
    def stop(self) -> None:
        self.pressed += 1
        self.presses.press(Press(id=str(self.pressed)))

    @rule(answers=st.integers(0, 3))
    def bridge_stops(self, answers: int) -> None:
        if self.up and self.presses.pending:
            for press in self.presses.pending[: answers + 1]:
                self.number += 1
                taken = StopTaken(press=press.id, number=self.number)
                self.presses.taken(taken)
                self.arbiter.stop_taken(taken)
            self.stopped, self.proven = True, ""
            if answers:  # else the feedback comes later
                self.bridge_issues()

    @rule()
    def bridge_resets(self) -> None:
        self.stopped, self.proven = False, ""
        self.bridge_issues()

    @rule(refuse=st.booleans())
    def bridge_answers(self, refuse: bool) -> None:
        if not self.on_the_way:
            return
        command = self.on_the_way.pop()
        if refuse or self.stopped:
            self.arbiter.refused(Refusal(event=command.event, reason="late", current=self.event))
        else:
            self.event = command.event
            if command.values == NEUTRAL:
                self.proven = self.seat.holder
        self.bridge_issues()

    @rule()
    def bridge_issues(self) -> None:
        self.issue += 1
        if self.up:
            feedback = _feedback(self.event, self.issue, stopped=self.stopped, number=self.number)
            assert self.clock.observe(feedback, 0.0)
            self.arbiter.feedback(feedback)

    @invariant()
    def at_most_one_is_in_flight(self) -> None:
        if hasattr(self, "on_the_way"):
            assert len(self.on_the_way) <= 1
            assert (self.arbiter.in_flight is not None) == bool(self.on_the_way)


DeskMachine.TestCase.settings = settings(max_examples=100, stateful_step_count=40, deadline=None)
TestDesk = DeskMachine.TestCase
