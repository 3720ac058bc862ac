"""The measurement that judges goals is made ahead of commands, while such commands come."""

from collections.abc import Sequence

from lockstep.robot_bridge.control.goals.measured_axes import LATELY, MeasuredAxes
from tests.robot_bridge.control.goals.goal_helpers import HangingArm


class Counting(HangingArm):
    tick_seconds = 0.25
    asked = 0

    def measured_axes(self) -> Sequence[float]:
        self.asked += 1
        return super().measured_axes()


def test_a_command_after_one_with_goals_is_judged_by_what_was_measured_since_the_tick_before_it() -> None:
    robot = Counting()
    places = MeasuredAxes(robot, 6)
    places()
    assert robot.asked == 1
    for tick in range(2, 5):
        places.look()
        places.measure_ahead()
        places.measure_ahead()
        assert robot.asked == tick
        places()
        assert robot.asked == tick


def test_nothing_is_measured_ahead_before_commands_with_goals_come_and_when_they_come_no_more() -> None:
    robot = Counting()
    places = MeasuredAxes(robot, 6)
    places.measure_ahead()
    assert robot.asked == 0
    places()
    for _ in range(40):
        places.look()
        places.measure_ahead()
    assert robot.asked == 1 + LATELY / Counting.tick_seconds
