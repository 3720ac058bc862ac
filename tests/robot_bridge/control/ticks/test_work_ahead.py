"""What is done between two ticks, and what is not."""

from collections.abc import Sequence

import pytest

from lockstep.robot_bridge.control.goals.measured_axes import MeasuredAxes
from lockstep.robot_bridge.control.ticks import work_ahead
from lockstep.robot_bridge.control.ticks.work_ahead import MOST_SLOW, SLOW, WorkAhead
from tests.robot_bridge.control.goals.goal_helpers import HangingArm


class Clock:
    now = 0.0

    def perf_counter(self) -> float:
        return self.now


class Slow(HangingArm):
    """Takes its time on a clock of the test."""

    ticks_on_command = True
    prepares = measures = 0.0  # s, that each takes
    prepared = asked = 0

    def __init__(self, clock: Clock) -> None:
        super().__init__()
        self._clock = clock

    def prepare(self) -> None:
        self.prepared += 1
        self._clock.now += self.prepares

    def measured_axes(self) -> Sequence[float]:
        self.asked += 1
        self._clock.now += self.measures
        return super().measured_axes()


class OnTheBeat(Slow):
    ticks_on_command = False


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(work_ahead, "time", clock)
    return clock


def test_it_prepares_and_measures_and_says_how_long_that_took(clock: Clock) -> None:
    robot = Slow(clock)
    robot.prepares, robot.measures = 0.001, 0.5 * SLOW * robot.tick_seconds
    places = MeasuredAxes(robot, 6)
    ahead = WorkAhead(robot, places)
    for _ in range(3):
        places()
        places.look()
        ahead.do()
        places()
    assert robot.prepared == 3
    assert robot.asked == 1 + 3, "nothing is measured twice between two ticks"
    assert ahead.seconds == pytest.approx(0.001 + robot.measures)


def test_an_adapter_that_takes_long_to_measure_each_time_is_asked_by_commands_alone_from_then_on(clock: Clock) -> None:
    robot = Slow(clock)
    robot.measures = 2 * SLOW * robot.tick_seconds
    places = MeasuredAxes(robot, 6)
    ahead = WorkAhead(robot, places)
    places()
    for _ in range(3 * MOST_SLOW):
        places.look()
        ahead.do()
    assert robot.asked == 1 + MOST_SLOW
    assert robot.prepared == 3 * MOST_SLOW


def test_one_slow_measurement_among_quick_ones_changes_nothing(clock: Clock) -> None:
    robot = Slow(clock)
    places = MeasuredAxes(robot, 6)
    ahead = WorkAhead(robot, places)
    places()
    for tick in range(3 * MOST_SLOW):
        robot.measures = 2 * SLOW * robot.tick_seconds if tick % 2 else 0.0
        places.look()
        ahead.do()
    assert robot.asked == 1 + 3 * MOST_SLOW


def test_work_that_took_long_once_is_not_left_out_for_good(clock: Clock) -> None:
    robot = Slow(clock)
    robot.prepares = 1.0
    ahead = WorkAhead(robot, MeasuredAxes(robot, 6))
    ahead.do()
    for _ in range(10):
        ahead.leave_out()
    assert ahead.seconds < robot.tick_seconds / 2


def test_a_robot_whose_commands_wait_for_a_tick_is_not_measured_ahead(clock: Clock) -> None:
    robot = OnTheBeat(clock)
    places = MeasuredAxes(robot, 6)
    ahead = WorkAhead(robot, places)
    places()
    places.look()
    ahead.do()
    assert (robot.asked, robot.prepared) == (1, 1)
