"""What the arbiter does with goal axes: null, goals, and the speed of both kinds of axes under the cap."""

import math
from collections.abc import Sequence
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.protocol.console import Report
from lockstep.protocol.description import Axis, RobotDescription, StartWarning
from lockstep.protocol.messages import Command, Feedback, StopState
from lockstep.server.control.command_arbiter import CommandArbiter, Forward, Refuse
from lockstep.server.control.seat.control_seat import ControlSeat
from lockstep.server.control.seat.seat_rules import SeatRules
from lockstep.server.control.seat.seat_times import SeatTimes
from lockstep.server.control.speed_cap import SpeedCap
from lockstep.server.event_clock import EventClock


def _axis(name: str, **fields: Any) -> Axis:
    return Axis(name=name, label=name, unit="rad", minimum=-1, maximum=1, slew=1, brake=4, **fields)


ROBOT = RobotDescription(
    name="arm", label="Arm", axes=(_axis("base"), _axis("j1", kind="goal", reach=0.5), _axis("lamp", rest=0.0))
)
NEUTRAL: tuple[float | None, ...] = (0.0, None, 0.0)


class Bench:
    """The seat of "me", with the link up and feedback 7 at hand; no neutral command was executed."""

    def __init__(self, cap: SpeedCap | None = None, robot: RobotDescription = ROBOT) -> None:
        self.clock, self.seat = EventClock(), ControlSeat(SeatTimes())
        self.rules = SeatRules(self.seat)
        self.arbiter = CommandArbiter(self.clock, self.seat, None, cap)
        self.clock.begin("e")
        self.rules.request("me", "operator", 0.0)
        self.arbiter.robot_link_up(robot)
        self.hear(7)

    def hear(self, event: int, **fields: Any) -> None:
        feedback = Feedback(event=event, issue=1, time=0.0, axes=[0, 0, 0], goals=[None, 0.25, None], **fields)
        if self.clock.observe(feedback, 0.0):
            self.arbiter.feedback(feedback)

    def send(
        self, event: int, values: Sequence[float | None], peer: str = "me", now: float = math.inf, **fields: Any
    ) -> Command | str:
        """Return the forwarded command, or the reason of the refusal."""
        outcome = self.arbiter.command(peer, Command(event=event, issue=1, values=values, **fields), now)
        assert isinstance(outcome, Forward | Refuse)
        return outcome.command if isinstance(outcome, Forward) else outcome.refusal.reason

    def executed(self, event: int, values: Sequence[float | None], peer: str = "me") -> None:
        assert isinstance(self.send(event, values, peer), Command)
        self.hear(event)


@pytest.mark.parametrize("goal", [0.25, 0.0])
def test_a_number_moves_even_if_the_axis_is_there_and_null_is_neutral(goal: float) -> None:
    bench = Bench()
    assert bench.send(8, (0.0, goal, 0.0)) == "not_neutral"
    bench.executed(8, NEUTRAL)
    assert isinstance(bench.send(9, (0.0, goal, 0.0)), Command)


@pytest.mark.parametrize(
    "values",
    [(None, 0.25, 0.0), (None, None, None), (0.0, math.nan, 0.0), (0.0, math.inf, 0.0), (math.nan, None, 0.0)],
)
def test_the_null_of_a_rate_axis_and_a_goal_that_is_not_finite_are_not_numbers(values: Sequence[float | None]) -> None:
    bench = Bench()
    bench.executed(8, NEUTRAL)
    assert bench.send(9, values) == "not_a_number"


def test_a_goal_passes_as_it_is_because_the_bridge_knows_where_the_robot_is() -> None:
    bench = Bench()
    bench.executed(8, NEUTRAL)
    command = bench.send(9, (5.0, 1.2, 0.0))
    assert isinstance(command, Command)
    assert command.values == [1.0, 1.2, 0.0]  # a rate is clamped


@pytest.mark.parametrize("asked", [1.0, 0.5, 0.1])
def test_the_cap_lowers_the_speed_of_goals_and_never_raises_what_the_operator_asked_for(asked: float) -> None:
    bench = Bench(SpeedCap("on"))  # nobody has reported a delay: a fifth of the speed
    bench.executed(8, NEUTRAL)
    command = bench.send(9, (1.0, 0.3, 0.0), speed=asked)
    assert isinstance(command, Command)
    assert command.values == [0.2, 0.3, 0.0]  # the goal stays, its speed falls
    assert command.speed == pytest.approx(min(asked, 0.2))


def test_without_a_cap_the_speed_is_the_operators() -> None:
    cap = SpeedCap("off")
    cap.reported("me", Report(picture_delay_ms=900), 0.0)
    bench = Bench(cap)
    bench.executed(8, NEUTRAL)
    command = bench.send(9, (0.0, 0.3, 0.0), now=0.0, speed=0.75)
    assert isinstance(command, Command)
    assert command.speed == 0.75


def test_the_speed_of_a_command_without_goal_axes_is_left_alone() -> None:
    robot = RobotDescription(name="r", label="R", axes=ROBOT.axes[:1])
    bench = Bench(SpeedCap("on"), robot)
    command = bench.send(8, (0.0,))
    assert isinstance(command, Command)
    assert command.speed == 1.0


def test_a_lamp_that_warns_does_not_count_as_motion_beside_goals_that_stay() -> None:
    warned = StartWarning(seconds=1, axis="lamp", value=1)
    bench = Bench(robot=RobotDescription(name="arm", label="Arm", axes=ROBOT.axes, start_warning=warned))
    assert isinstance(bench.send(8, (0.0, None, 1.0)), Command)


def test_after_a_take_over_a_stop_and_a_new_link_goals_wait_for_the_holders_own_neutral_command() -> None:
    bench = Bench()
    bench.executed(8, NEUTRAL)
    bench.executed(9, (0.0, 0.3, 0.0))
    bench.rules.take("boss", "supervisor", 1.0)
    assert bench.send(10, (0.0, 0.25, 0.0), "boss") == "not_neutral"
    bench.executed(10, NEUTRAL, "boss")
    bench.executed(11, (0.0, 0.25, 0.0), "boss")
    bench.hear(12, stop=StopState(stopped=True, number=1))
    bench.hear(13, stop=StopState(number=1))
    assert bench.send(14, (0.0, 0.25, 0.0), "boss") == "not_neutral"
    bench.executed(14, NEUTRAL, "boss")
    bench.arbiter.robot_link_down()
    bench.arbiter.robot_link_up(ROBOT)
    bench.hear(15)
    assert bench.send(16, (0.0, 0.25, 0.0), "boss") == "not_neutral"


value = st.one_of(st.none(), st.floats())


@given(value, value, value, st.floats(0, 1), st.sampled_from(["on", "off"]), st.booleans())
def test_whatever_the_values_are_no_command_becomes_faster_or_has_another_goal(
    base: float | None, goal: float | None, lamp: float | None, speed: float, mode: Any, proven: bool
) -> None:
    bench = Bench(SpeedCap(mode))
    if proven:
        bench.executed(8, NEUTRAL)
    event = 9 if proven else 8
    command = bench.send(event, (base, goal, lamp), speed=speed)
    if not isinstance(command, Command):
        return
    assert base is not None
    assert lamp is not None
    assert goal is None or (math.isfinite(goal) and proven)
    assert command.values[1] == goal
    assert command.speed <= speed
    for asked, forwarded in ((base, command.values[0]), (lamp, command.values[2])):
        assert forwarded is not None
        assert abs(forwarded) <= min(abs(asked), 1.0 if mode == "off" else 0.2 + 1e-12)
