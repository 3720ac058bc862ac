"""What is applied on the way to rest when calls of the adapter raise."""

from collections.abc import Sequence

import pytest

from lockstep.robot_bridge.control.coming_to_rest import PATIENCE, REPEATS, ComingToRest
from lockstep.robot_bridge.control.limits.axis_shaper import AxisShaper
from lockstep.robot_bridge.robots.planar.description import DESCRIPTION
from lockstep.robot_bridge.robots.planar.robot import PlanarRobot
from tests.robot_bridge.control.goals.goal_helpers import ARM_AXES, HangingArm

DT = PlanarRobot.tick_seconds
BRAKE = DESCRIPTION.axes[0].brake
NEUTRAL = [0.0, 0.0, 0.0]
FAST = [0.5, 0.0, 0.0]


class Failing(PlanarRobot):
    """Raises what it is told to, per call, as often as it is told to."""

    def __init__(self, **failures: int) -> None:
        super().__init__()
        self.applied: list[list[float]] = []
        self.stops = 0
        self._failures = failures
        self.error: BaseException = OSError("no answer")

    def _call(self, name: str) -> None:
        left = self._failures.get(name, 0)
        if left:
            self._failures[name] = left - 1
            raise self.error

    def apply(self, values: Sequence[float]) -> None:
        self._call("apply")
        self.applied.append(list(values))
        super().apply(values)

    def tick(self) -> None:
        self._call("tick")
        super().tick()

    def stop(self) -> None:
        self._call("stop")
        self.stops += 1
        super().stop()


def driving() -> AxisShaper:
    shaper = AxisShaper(DESCRIPTION.axes, hold=DESCRIPTION.hold)
    shaper.drive(FAST, 0.0)
    for tick in range(round(DESCRIPTION.hold / DT / 2)):
        shaper.step(tick * DT, DT)
    assert shaper.values[0] > 0.1
    return shaper


def steps_until_done(leaving: ComingToRest) -> int:
    for tick in range(10_000):
        if leaving.step(tick * DT):
            return tick + 1
    raise AssertionError("it never ends")


def test_a_robot_that_works_comes_to_rest_at_the_brake_rate() -> None:
    robot, shaper = Failing(), driving()
    speed = shaper.values[0]
    steps_until_done(ComingToRest(robot, shaper, DESCRIPTION.hold, 0.0))
    speeds = [speed, *(values[0] for values in robot.applied)]
    assert all(0 <= before - after <= BRAKE * DT + 1e-9 for before, after in zip(speeds, speeds[1:], strict=False))
    assert robot.applied[-REPEATS:] == [NEUTRAL] * REPEATS
    assert robot.applied[0] != NEUTRAL


@pytest.mark.parametrize("error", [OSError("no answer"), SystemExit(3), KeyboardInterrupt(), BaseException("what")])
def test_after_an_apply_that_raised_the_rest_values_follow_at_once(error: BaseException) -> None:
    robot = Failing(apply=1)
    robot.error = error
    steps_until_done(ComingToRest(robot, driving(), DESCRIPTION.hold, 0.0))
    assert robot.applied == [NEUTRAL] * REPEATS


def test_a_tick_that_always_raises_keeps_no_rest_value_from_being_applied() -> None:
    robot = Failing(tick=10_000)
    leaving = ComingToRest(robot, driving(), DESCRIPTION.hold, 0.0)
    steps_until_done(leaving)
    assert leaving.rests
    assert robot.applied[-1] == NEUTRAL


def test_an_adapter_that_takes_nothing_is_tried_for_hold_and_longer_and_then_given_up() -> None:
    robot = Failing(apply=10_000)
    leaving = ComingToRest(robot, driving(), DESCRIPTION.hold, 0.0)
    assert steps_until_done(leaving) >= (DESCRIPTION.hold + PATIENCE) / DT
    assert not leaving.rests
    leaving.stop()
    assert robot.stops == 1


def test_an_adapter_that_answers_again_after_a_second_is_at_rest_then() -> None:
    robot = Failing(apply=round(1.0 / DT))
    leaving = ComingToRest(robot, driving(), DESCRIPTION.hold, 0.0)
    steps_until_done(leaving)
    assert leaving.rests
    assert robot.applied == [NEUTRAL] * REPEATS


def test_without_more_ticks_the_rest_values_are_applied_at_once() -> None:
    robot = Failing(apply=1, tick=2)
    leaving = ComingToRest(robot, driving(), DESCRIPTION.hold, 0.0)
    leaving.at_once()
    assert robot.applied == [NEUTRAL] * (REPEATS - 1)


def test_a_stop_that_raises_is_tried_again() -> None:
    robot = Failing(stop=2)
    ComingToRest(robot, driving(), DESCRIPTION.hold, 0.0).stop()
    assert robot.stops == 1


def arm_in_motion() -> tuple[HangingArm, AxisShaper]:
    robot = HangingArm()
    shaper = AxisShaper(ARM_AXES, hold=0.3)
    shaper.begin(robot.measured_axes(), robot.goals())
    for tick in range(20):
        shaper.drive([0.0, 1.0, None, None, None, None], tick * DT)
        robot.apply(shaper.step(tick * DT, DT))
    return robot, shaper


def test_a_goal_brakes_and_stays_where_it_has_come_to() -> None:
    robot, shaper = arm_in_motion()
    moving, driven = robot.pursued[1], len(robot.applied)
    leaving = ComingToRest(robot, shaper, 0.3, 0.0)
    steps_until_done(leaving)
    assert leaving.rests
    goals = [values[1] for values in robot.applied[driven:]]
    assert goals == sorted(goals)
    assert moving < goals[-1] < moving + ARM_AXES[1].slew ** 2 / (2 * ARM_AXES[1].brake) + ARM_AXES[1].slew * DT


def test_after_an_apply_that_raised_a_goal_stands_still_at_once() -> None:
    robot, shaper = arm_in_motion()
    ComingToRest(robot, shaper, 0.3, 0.0).at_once()
    assert [values[1] for values in robot.applied[-REPEATS:]] == [robot.applied[-REPEATS - 1][1]] * REPEATS


def test_where_a_goal_was_never_known_nothing_is_applied_and_the_robots_own_stop_is_called() -> None:
    robot = HangingArm()
    shaper = AxisShaper(ARM_AXES, hold=0.3)
    leaving = ComingToRest(robot, shaper, 0.3, 0.0)
    steps_until_done(leaving)
    leaving.stop()
    assert leaving.rests
    assert robot.applied == []
    assert robot.calls == ["stop"]
