from typing import Any

import pytest

from lockstep.protocol.description import Axis, RobotDescription
from lockstep.protocol.messages import Command, Feedback, LinkMessage, Refusal, Rest
from lockstep.server.audit.records import Actor
from lockstep.server.control.command_arbiter import CommandArbiter
from lockstep.server.control.command_service import CommandService
from lockstep.server.control.refusals import Refusals
from lockstep.server.control.seat.control_seat import ControlSeat
from lockstep.server.control.seat.seat_rules import SeatRules
from lockstep.server.control.seat.seat_times import SeatTimes
from lockstep.server.event_clock import EventClock
from lockstep.server.session_events import (
    CommandForwarded,
    CommandRefused,
    CommandRepeated,
    Refused,
    RestForwarded,
    SessionEvent,
    SessionEvents,
)
from lockstep.server.telemetry.metrics import Metrics
from tests.makers import feedback

AXIS = Axis(name="x", label="X", unit="m/s", minimum=-1.0, maximum=1.0, slew=1.0, brake=1.0)
ROBOT = RobotDescription(name="r", label="R", axes=(AXIS,))


class Ann:
    """The peer that holds the seat."""

    id = "ann"
    actor = Actor("Ann", "operator", "ann", "link")

    def __init__(self) -> None:
        self.refused: list[str] = []
        self.feedback = 0
        self.may_be_answered = True
        self.answers = self
        self.media = self
        self.queues = False

    def send(self, channel: str, message: Refusal) -> None:
        self.refused.append(message.reason)

    def send_feedback(self, text: str) -> None:
        self.feedback += 1

    def allows(self, now: float, *, queues: bool) -> bool:
        return self.may_be_answered


class Bench:
    """The link is up, feedback 7 is at hand, and Ann has sent a neutral command before."""

    def __init__(self) -> None:
        self.clock, seat, self.ann = EventClock(), ControlSeat(SeatTimes()), Ann()
        self.up = True
        self.sent: list[LinkMessage] = []
        self.published: list[type[SessionEvent]] = []
        self.moved_by: list[str] = []
        events = SessionEvents(Metrics(process=False).faults)
        for kind in (CommandForwarded, CommandRefused, CommandRepeated, Refused, RestForwarded):
            events.subscribe(kind, self._heard)
        refusals = Refusals(self.clock, events)
        arbiter = CommandArbiter(self.clock, seat)
        self.service = CommandService(arbiter, self, self, self, self.clock, refusals, events)
        SeatRules(seat).request("ann", "operator", 0.0)
        arbiter.robot_link_up(ROBOT)
        self.show(feedback(7, nonce=5))
        seat.neutral("ann")

    def _heard(self, event: SessionEvent) -> None:
        self.published.append(type(event))

    def send(self, message: LinkMessage) -> bool:
        self.sent += [message] if self.up else []
        return self.up

    def moved(self, peer: Any) -> None:
        self.moved_by.append(peer.id)

    def renews(self, id: str) -> bool:
        return id == "mine"

    def show(self, shown: Feedback) -> Command | None:
        assert self.clock.observe(shown, 0.0)
        return self.service.feedback(shown)

    def command(self, value: float, *, event: int = 8, action: str = "") -> None:
        command = Command(event=event, issue=1, nonce=5, values=[value], action=action)
        self.service.command(self.ann, command, 0.0)  # type: ignore[arg-type]


@pytest.mark.parametrize(("value", "action", "moves"), [(0.5, "", True), (0.0, "", False), (0.0, "mine", True)])
def test_a_command_that_passes_is_sent_and_ends_the_idle_time_if_it_moves_the_robot(
    value: float, action: str, moves: bool
) -> None:
    bench = Bench()
    bench.command(value, action=action)
    assert [type(each) for each in bench.sent] == [Command]
    assert (bench.published, bool(bench.moved_by)) == ([CommandForwarded], moves)
    executed = bench.show(feedback(8))
    assert executed is not None
    assert executed.values == [value]
    assert bench.show(feedback(8, 2)) is None


def test_a_command_or_rest_that_the_link_does_not_take_is_refused() -> None:
    bench = Bench()
    bench.up = False
    bench.command(0.5)
    bench.service.rest(bench.ann, Rest(event=8))  # type: ignore[arg-type]
    assert bench.ann.refused == ["link_down", "link_down"]
    assert bench.published == [Refused, CommandRefused, Refused]


def test_a_command_that_is_behind_is_refused_and_answered_with_the_newest_feedback() -> None:
    bench = Bench()
    bench.command(0.5, event=12)
    assert (bench.ann.refused, bench.ann.feedback) == (["out_of_order"], 1)


def test_a_repeat_is_answered_unless_its_path_queues() -> None:
    bench = Bench()
    bench.command(0.5)
    bench.show(feedback(8))
    bench.command(0.5)
    bench.ann.may_be_answered = False
    bench.command(0.5)
    assert bench.ann.feedback == 1
    assert bench.published == [CommandForwarded, CommandRepeated, CommandRepeated]


def test_the_holder_and_the_console_rest_the_robot() -> None:
    bench = Bench()
    bench.service.rest(bench.ann, Rest(event=7))  # type: ignore[arg-type]
    bench.service.abandon("released")
    assert [type(each) for each in bench.sent] == [Rest, Rest]
    assert bench.published == [RestForwarded, RestForwarded]
