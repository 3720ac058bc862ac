"""What the values of a command mean for rate and goal axes."""

import math

import pytest

from lockstep.protocol.messages import Command
from lockstep.protocol.serial import event_after
from lockstep.robot_bridge.control.event_core import EventCore, Executed, Refused
from lockstep.robot_bridge.control.goals.command_values import CommandValues
from lockstep.robot_bridge.robots.base import Measurement
from tests.robot_bridge.control.core_helpers import MAX_AGE, NONCE, reason
from tests.robot_bridge.control.goals.goal_helpers import ARM_AXES, HangingArm

POSES = HangingArm().describe().poses
PLACES = [0.0, 0.2, 0.4, 3.0, 0.6, -0.2]
STAY = [0.0, None, None, None, None, None]
MEASURED = Measurement(axes=PLACES, joints=[], wrench=[], ranges=[], at_rest=True, faults=[])


def values(**given: float | None) -> list[float | None]:
    """A neutral command but for these."""
    names = [axis.name for axis in ARM_AXES]
    found = list(STAY)
    for name, value in given.items():
        found[names.index(name)] = value
    return found


def meaning(places: list[float] | None = PLACES) -> CommandValues:
    return CommandValues(ARM_AXES, poses=POSES, measured=None if places is None else lambda: places)


def test_null_for_all_goal_axes_and_rest_for_all_rate_axes_is_neutral() -> None:
    assert not meaning().moves(STAY)
    assert meaning().moves(values(base=0.1))


def test_a_number_moves_even_if_it_is_where_the_axis_is() -> None:
    assert meaning().moves(values(shoulder=0.2))


@pytest.mark.parametrize(
    "wrong", [values(base=None), values(shoulder=math.nan), values(elbow=math.inf), values(base=-math.inf)]
)
def test_null_for_a_rate_axis_and_what_is_not_finite_is_not_a_number(wrong: list[float | None]) -> None:
    assert meaning().misfit(wrong) == ("not_a_number", "")


@pytest.mark.parametrize("speed", [math.nan, -0.1, 1.1])
def test_a_speed_is_a_share(speed: float) -> None:
    assert meaning().misfit(STAY, speed) == ("not_a_number", "speed")


def test_a_pose_and_the_axes_that_it_stands_in_for_conflict() -> None:
    refused = meaning().misfit(values(shoulder=0.2, z=0.0))
    assert refused is not None
    assert refused[0] == "conflict"
    assert "shoulder" in refused[1]
    assert "z" in refused[1]
    assert meaning().misfit(values(x=0.6, z=0.0, turn=3.0)) is None
    assert meaning().misfit(values(shoulder=0.2, elbow=0.0, turn=3.0)) is None


def test_a_goal_within_reach_of_the_measured_value_is_no_jump() -> None:
    assert meaning().jump(values(shoulder=0.7, elbow=-0.1)) == ""
    assert meaning().jump(values(base=1.0)) == ""


@pytest.mark.parametrize("far", [values(shoulder=0.71), values(shoulder=0.2, elbow=-0.11), values(shoulder=-1e308)])
def test_a_goal_beyond_reach_is_a_jump(far: list[float | None]) -> None:
    assert "its reach is 0.5" in meaning().jump(far)


def test_with_wrap_the_shorter_way_counts() -> None:
    assert meaning().jump(values(turn=-3.0)) == ""
    assert meaning().jump(values(turn=3.0 + 20 * math.pi)) == ""
    assert "turn" in meaning().jump(values(turn=1.9))
    meaning().jump(values(turn=-1.7e308))  # it is some place on the circle, and computing with it raises nothing


def test_where_the_axis_is_not_known_every_goal_is_a_jump() -> None:
    unknown = [*PLACES[:1], math.nan, *PLACES[2:]]
    assert "not known" in meaning(unknown).jump(values(shoulder=0.2))
    assert meaning(unknown).jump(values(elbow=0.4)) == ""
    assert "not known" in meaning(None).jump(values(elbow=0.4))


class Operator:
    """Answers the newest feedback of a core whose axes are measured at PLACES."""

    def __init__(self) -> None:
        self.asked = 0
        self.core = EventCore(
            ARM_AXES, max_event_age=MAX_AGE, poses=POSES, measured=self._measured, nonces=lambda: NONCE
        )
        self.issue()

    def _measured(self) -> list[float]:
        self.asked += 1
        return PLACES

    def issue(self) -> None:
        self.feedback = self.core.issue(MEASURED, 0.0, goals=[None, *PLACES[1:]])

    def send(self, wanted: list[float | None], now: float = 0.0) -> str:
        answered = self.feedback
        command = Command(event=event_after(answered.event), issue=answered.issue, nonce=NONCE, values=wanted)
        self.outcome = self.core.command(command, now)
        return reason(self.outcome)

    @property
    def detail(self) -> str:
        return self.outcome.refusal.detail if isinstance(self.outcome, Refused) else ""


def test_a_jump_executes_nothing_and_its_event_is_not_used_up() -> None:
    operator = Operator()
    assert operator.send(STAY) == "executed"
    operator.issue()
    assert operator.send(values(shoulder=1.0)) == "jump"
    assert operator.detail == "shoulder: 0.8 rad from where it is; its reach is 0.5"
    assert operator.core.pending is None
    assert operator.send(values(shoulder=0.5)) == "executed"
    assert operator.outcome == Executed(3, values(shoulder=0.5), 1.0)


def test_what_is_refused_for_another_reason_is_not_measured() -> None:
    operator = Operator()
    far = values(shoulder=9.0)
    assert operator.send(far) == "not_neutral"
    assert operator.send(STAY) == "executed"
    operator.issue()
    assert operator.send(far, now=10.0) == "late"
    operator.core.rest(operator.feedback.event + 1)
    assert operator.send(far) == "rested"
    operator.core.stops.stop("", "", "", 0.0)
    assert operator.send(far) == "stopped"
    assert operator.asked == 0


def test_a_jump_does_not_count_as_the_neutral_command_that_is_needed() -> None:
    operator = Operator()
    assert operator.send(values(shoulder=9.0)) == "not_neutral"
    assert operator.core.interlock.needed


def test_the_feedback_has_the_applied_goals() -> None:
    assert Operator().feedback.goals == [None, *PLACES[1:]]
