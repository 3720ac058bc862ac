import math
from typing import Any

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from robot_bridge.protocol.description import Axis, RobotDescription
from robot_bridge.protocol.messages import Command, Feedback, Refusal, Reset, Rest, Stop, StopState
from robot_bridge.protocol.serial import MAX_EVENT, event_after
from server.command_desk import STOP_REPEAT, Absorbed, Answer, CommandDesk, Forward, Outcome, Refuse
from server.event_clock import EventClock
from server.seat import ControlSeat, SeatTimes

ROBOT = RobotDescription(
    name="r",
    label="R",
    axes=tuple(Axis(name=name, label=name, unit="m/s", minimum=-1, maximum=2, slew=1, brake=1) for name in ("x", "y")),
)


def _feedback(event: int, issue: int = 1, *, stopped: bool = False) -> Feedback:
    return Feedback(event=event, issue=issue, time=0.0, axes=[0, 0], stop=StopState(stopped=stopped))


def _command(event: int, values: list[float] | None = None) -> Command:
    return Command(event=event, issue=1, values=[0.5, 0.5] if values is None else values)


class Bench:
    """A desk whose seat "me" holds, with the link up and feedback 7 at hand."""

    def __init__(self, *, held: bool = True, up: bool = True, stopped: bool = False) -> None:
        self.clock, self.seat = EventClock(), ControlSeat(SeatTimes())
        self.desk = CommandDesk(self.clock, self.seat)
        self.clock.begin("e")
        if held:
            self.seat.request("me", "operator", 0.0)
            self.seat.neutral("me")
        if up:
            self.desk.link_up(ROBOT)
            self.hear(_feedback(7, stopped=stopped))

    def hear(self, feedback: Feedback) -> None:
        if self.clock.observe(feedback, 0.0):
            self.desk.feedback(feedback)


def _reason(outcome: Outcome) -> str:
    assert isinstance(outcome, Refuse)
    return outcome.refusal.reason


def test_the_next_command_passes_once_and_its_repeat_is_absorbed() -> None:
    bench = Bench()
    assert bench.desk.command("me", _command(8)) == Forward(_command(8))
    assert bench.desk.command("me", _command(8, [1.0, 1.0])) == Absorbed()
    bench.hear(_feedback(8))
    assert bench.desk.in_flight is None
    assert bench.desk.command("me", _command(8)) == Answer(_feedback(8))
    assert bench.desk.command("me", _command(9)) == Forward(_command(9))


NEUTRAL = [0.0, 0.0]


def test_a_new_holder_sends_a_neutral_command_before_a_moving_one() -> None:
    bench = Bench()
    bench.seat.take("next", "supervisor", 0.0)
    assert _reason(bench.desk.command("next", _command(8))) == "not_neutral"
    assert bench.desk.in_flight is None
    assert bench.desk.command("next", _command(8, NEUTRAL)) == Forward(_command(8, NEUTRAL))
    assert bench.desk.command("next", _command(8)) == Absorbed(), "a repeat with a newer intention under the same event"
    bench.hear(_feedback(8))
    assert bench.desk.command("next", _command(9)) == Forward(_command(9))
    bench.seat.take("last", "supervisor", 0.0)
    bench.seat.take("next", "supervisor", 0.0)
    bench.hear(_feedback(9))
    assert _reason(bench.desk.command("next", _command(10))) == "not_neutral", "also one who drove before"


def test_a_neutral_command_that_is_refused_proves_nothing() -> None:
    bench = Bench()
    bench.seat.take("next", "supervisor", 0.0)
    bench.desk.command("next", _command(20, NEUTRAL))
    bench.desk.command("other", _command(8, NEUTRAL))
    assert _reason(bench.desk.command("next", _command(8))) == "not_neutral"


def test_what_the_last_holder_executed_is_not_taken_for_the_new_ones() -> None:
    bench = Bench()
    bench.desk.command("me", _command(8))
    bench.seat.take("next", "supervisor", 0.0)
    bench.desk.abandon()
    assert _reason(bench.desk.command("next", _command(8, NEUTRAL))) == "out_of_order", "it is in flight still"
    bench.hear(_feedback(8))
    assert _reason(bench.desk.command("next", _command(8, NEUTRAL))) == "out_of_order", "it was the other's"
    assert bench.desk.command("next", _command(9, NEUTRAL)) == Forward(_command(9, NEUTRAL))


def test_a_repeat_after_the_link_was_lost_is_answered_if_it_was_executed() -> None:
    bench = Bench()
    bench.desk.command("me", _command(8))
    bench.desk.link_down()
    bench.desk.link_up(ROBOT)
    bench.hear(_feedback(8))
    assert bench.desk.command("me", _command(8)) == Answer(_feedback(8))
    bench.desk.epoch_ends()
    assert _reason(bench.desk.command("me", _command(8))) == "out_of_order", "references of another epoch"


def test_values_are_clamped_to_the_limits() -> None:
    outcome = Bench().desk.command("me", _command(8, [-5.0, 5.0]))
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
    assert _reason(Bench(**bench).desk.command("me", command)) == reason


def test_a_link_without_feedback_yet_is_as_good_as_down() -> None:
    bench = Bench(up=False)
    bench.desk.link_up(ROBOT)
    assert _reason(bench.desk.command("me", _command(8))) == "link_down"


def test_while_one_is_in_flight_no_other_event_passes() -> None:
    bench = Bench()
    bench.desk.command("me", _command(8))
    assert _reason(bench.desk.command("me", _command(9))) == "out_of_order"


def test_the_successor_wraps() -> None:
    bench = Bench(up=False)
    bench.desk.link_up(ROBOT)
    bench.hear(_feedback(MAX_EVENT))
    assert bench.desk.command("me", _command(1)) == Forward(_command(1))
    bench.hear(_feedback(1))
    assert bench.desk.in_flight is None


def test_a_refusal_frees_the_way_and_goes_to_the_sender() -> None:
    bench = Bench()
    bench.desk.command("me", _command(8))
    assert bench.desk.refused(Refusal(event=8, reason="late", current=7)) == "me"
    assert bench.desk.command("me", _command(8)) == Forward(_command(8))


def test_a_refusal_of_something_else_goes_to_the_holder() -> None:
    bench = Bench()
    bench.desk.command("me", _command(8))
    assert bench.desk.refused(Refusal(event=5, reason="late", current=7)) == "me"
    assert bench.desk.in_flight is not None
    bench.seat.release("me", 0.0)
    assert bench.desk.refused(Refusal(event=5, reason="late", current=7)) == ""


def test_what_was_in_flight_is_forgotten_with_the_link() -> None:
    bench = Bench()
    bench.desk.command("me", _command(8))
    bench.desk.link_down()
    assert _reason(bench.desk.command("me", _command(8))) == "link_down"
    bench.desk.link_up(ROBOT)
    assert bench.desk.command("me", _command(8)) == Forward(_command(8))


def test_a_rest_of_the_holder_passes_and_repeats_wait_for_an_answer() -> None:
    bench = Bench()
    assert bench.desk.rest("me", Rest(event=8)) == Forward(Rest(event=8))
    assert bench.desk.rest("me", Rest(event=8)) == Absorbed()
    assert bench.desk.rest("me", Rest(event=7)) == Forward(Rest(event=7))
    bench.hear(_feedback(7, 2))
    assert bench.desk.rest("me", Rest(event=7)) == Forward(Rest(event=7))


def test_a_rest_passes_while_a_command_is_in_flight_and_while_stopped() -> None:
    bench = Bench(stopped=True)
    assert bench.desk.rest("me", Rest(event=8)) == Forward(Rest(event=8))
    bench = Bench()
    bench.desk.command("me", _command(8))
    assert bench.desk.rest("me", Rest(event=8)) == Forward(Rest(event=8))


def test_a_rest_that_names_a_far_event_names_the_next_instead() -> None:
    assert Bench().desk.rest("me", Rest(event=1000)) == Forward(Rest(event=8))


def test_others_cannot_rest_the_robot() -> None:
    assert _reason(Bench().desk.rest("other", Rest(event=8))) == "no_seat"
    assert _reason(Bench(up=False).desk.rest("me", Rest(event=8))) == "link_down"


def test_when_the_holder_is_gone_the_next_event_is_void_too() -> None:
    bench = Bench()
    bench.desk.command("me", _command(8))
    bench.seat.gone("me", 0.0)
    assert bench.desk.abandon() == Forward(Rest(event=8))


def test_a_stop_passes_always_and_refuses_commands_before_the_bridge_says_so() -> None:
    bench = Bench(held=False, up=False)
    assert bench.desk.stop("any", "why", 0.0) == Forward(Stop(by="any", reason="why"))
    bench = Bench()
    assert bench.desk.stop("any", "", 0.0) == Forward(Stop(by="any", reason=""))
    assert _reason(bench.desk.command("me", _command(8))) == "stopped"
    bench.hear(_feedback(7, 2))  # issued before the stop arrived
    assert _reason(bench.desk.command("me", _command(8))) == "stopped"
    bench.hear(_feedback(7, 3, stopped=True))
    bench.hear(_feedback(7, 4))  # and reset
    assert bench.desk.command("me", _command(8)) == Forward(_command(8))


def test_a_flood_of_stops_is_absorbed_but_never_across_a_reset() -> None:
    desk = Bench().desk
    desk.stop("any", "", 0.0)
    assert desk.stop("any", "", STOP_REPEAT / 2) == Absorbed()
    assert desk.reset("me", 1) == Forward(Reset(by="me", number=1))
    assert desk.stop("any", "", STOP_REPEAT / 2) == Forward(Stop(by="any"))
    assert desk.stop("any", "", STOP_REPEAT * 2) == Forward(Stop(by="any"))


def test_a_stop_that_nobody_confirmed_is_said_first_on_the_next_link() -> None:
    bench = Bench()
    bench.desk.stop("first", "", 0.0)
    bench.desk.link_down()
    bench.desk.stop("second", "", 0.0)
    assert bench.desk.link_up(ROBOT) == Stop(by="first")
    assert _reason(bench.desk.command("me", _command(8))) == "stopped"
    bench.hear(_feedback(7, 2, stopped=True))
    bench.desk.link_down()
    assert bench.desk.link_up(ROBOT) is None


def test_a_stop_without_a_link_is_kept_even_if_the_robot_was_stopped_when_last_seen() -> None:
    bench = Bench(stopped=True)
    bench.desk.link_down()
    bench.desk.stop("any", "", 0.0)
    assert bench.desk.link_up(ROBOT) == Stop(by="any")


def test_a_bridge_that_starts_anew_is_stopped_again_if_the_last_one_was() -> None:
    bench = Bench(stopped=True)
    bench.desk.link_down()
    bench.desk.epoch_ends()
    bench.clock.begin("another")
    assert isinstance(bench.desk.link_up(ROBOT), Stop)
    bench.hear(_feedback(1, 1))
    assert _reason(bench.desk.command("me", _command(2))) == "stopped"
    bench.desk.reset("me", 1)
    assert bench.desk.command("me", _command(2)) == Forward(_command(2))


def test_what_is_latched_is_the_stop_that_holds_or_is_still_to_arrive() -> None:
    bench = Bench()
    latched = [bench.desk.latched]
    bench.desk.stop("any", "smoke", 0.0)
    latched.append(bench.desk.latched)
    bench.hear(_feedback(7, 2, stopped=True))
    latched.append(bench.desk.latched)
    bench.desk.reset("me", 1)
    bench.hear(_feedback(7, 3))
    latched.append(bench.desk.latched)
    as_the_robot_says = Stop(by="", reason="")
    assert latched == [None, Stop(by="any", reason="smoke"), as_the_robot_says, None]


def test_a_stop_that_was_reset_before_any_feedback_showed_it_is_over() -> None:
    bench = Bench()
    bench.desk.stop("any", "", 0.0)
    bench.desk.reset("me", 1)
    bench.hear(_feedback(7, 2))
    assert bench.desk.command("me", _command(8)) == Forward(_command(8))


def test_a_reset_needs_the_link() -> None:
    assert _reason(Bench(up=False).desk.reset("me", 1)) == "link_down"


class DeskMachine(RuleBasedStateMachine):
    """Peers, a bridge that behaves as promised, a link that breaks: in any order."""

    peers = st.sampled_from(["a", "b", "c"])

    @initialize(event=st.sampled_from([1, 2, MAX_EVENT - 2, MAX_EVENT]))
    def start(self, event: int) -> None:
        self.clock, self.seat = EventClock(), ControlSeat(SeatTimes())
        self.desk = CommandDesk(self.clock, self.seat)
        self.up = self.stopped = self.stop_sent = False
        self.event, self.issue = event, 1
        self.on_the_way: list[Command] = []  # forwarded, not yet seen by the bridge

    @rule()
    def link_up(self) -> None:
        self.stop_sent = self.desk.link_up(ROBOT) is not None
        self.up = True
        self.on_the_way = []
        self.bridge_issues()

    @rule()
    def link_down(self) -> None:
        self.desk.link_down()
        self.up, self.on_the_way = False, []

    @rule(peer=peers, operator=st.booleans())
    def request(self, peer: str, operator: bool) -> None:
        self.seat.request(peer, "operator" if operator else "observer", 0.0)

    @rule(peer=peers)
    def leave(self, peer: str) -> None:
        if self.seat.gone(peer, 0.0).rest:
            self.desk.abandon()

    @rule(peer=peers, offset=st.integers(-1, 2), values=st.lists(st.floats(), min_size=1, max_size=3))
    def command(self, peer: str, offset: int, values: list[float]) -> None:
        named = (self.event + offset - 1) % MAX_EVENT + 1
        known_stop = self.clock.stop.stopped or self.stop_sent
        outcome = self.desk.command(peer, Command(event=named, issue=self.issue, values=values))
        if isinstance(outcome, Forward):
            assert isinstance(outcome.message, Command)
            assert self.seat.holder == peer
            assert self.up
            assert not known_stop
            assert not self.on_the_way
            assert outcome.message.event == event_after(self.clock.event)
            assert all(-1 <= value <= 2 for value in outcome.message.values)
            self.on_the_way.append(outcome.message)

    @rule(peer=peers)
    def rest(self, peer: str) -> None:
        outcome = self.desk.rest(peer, Rest(event=self.event))
        if isinstance(outcome, Forward):
            assert self.seat.holder == peer

    @rule()
    def stop(self) -> None:
        self.desk.stop("x", "", 0.0)
        self.stop_sent = not self.clock.stop.stopped or not self.up or self.stop_sent

    @rule()
    def bridge_stops(self) -> None:
        if self.stop_sent and self.up:
            self.stopped, self.stop_sent = True, False
            self.bridge_issues()

    @rule()
    def bridge_resets(self) -> None:
        self.stopped = False
        self.bridge_issues()

    @rule(refuse=st.booleans())
    def bridge_answers(self, refuse: bool) -> None:
        if not self.on_the_way:
            return
        command = self.on_the_way.pop()
        if refuse or self.stopped:
            self.desk.refused(Refusal(event=command.event, reason="late", current=self.event))
        else:
            self.event = command.event
        self.bridge_issues()

    @rule()
    def bridge_issues(self) -> None:
        self.issue += 1
        if self.up:
            feedback = _feedback(self.event, self.issue, stopped=self.stopped)
            assert self.clock.observe(feedback, 0.0)
            self.desk.feedback(feedback)

    @invariant()
    def at_most_one_is_in_flight(self) -> None:
        if hasattr(self, "on_the_way"):
            assert len(self.on_the_way) <= 1
            assert (self.desk.in_flight is not None) == bool(self.on_the_way)


DeskMachine.TestCase.settings = settings(max_examples=100, stateful_step_count=40, deadline=None)
TestDesk = DeskMachine.TestCase
