"""The stop of each robot that needs nothing but this machine's processor: nothing applied moves it until the reset."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from lockstep.robot_bridge.errors import RobotUnavailable
from lockstep.robot_bridge.robots.base import Robot
from lockstep.robot_bridge.robots.registry import create_robot
from lockstep.robot_bridge.robots.so101.model_source import FOLDER_VARIABLE, arm_file
from lockstep.robot_bridge.robots.so101.robot import So101
from tests.robot_bridge.robots.so101.driver import MODEL_FOLDER

MODEL = Path(__file__).parents[3] / "docs" / "examples" / "mjcf" / "desk_arm.xml"


def mjcf() -> Robot:
    from lockstep.robot_bridge.robots.mjcf import create

    return create(MODEL)


def so101() -> Robot:
    return So101(arm_file({FOLDER_VARIABLE: str(MODEL_FOLDER)}))


@pytest.mark.parametrize(
    "make",
    [
        lambda: create_robot("planar"),
        lambda: create_robot("micromanipulator"),
        lambda: create_robot("mobile-manipulator"),
        mjcf,
        so101,
    ],
    ids=["planar", "micromanipulator", "mobile-manipulator", "mjcf", "so101"],
)
def test_a_stopped_robot_stands_whatever_is_applied_until_it_is_reset(make: Callable[[], Robot]) -> None:
    try:
        robot = make()
    except RobotUnavailable as error:
        pytest.skip(str(error))
    try:
        moving = motion(robot)
        run(robot, moving, 50)
        assert not robot.measure().at_rest
        robot.stop()
        robot.stop()
        run(robot, moving, 250)
        before = robot.positions()
        assert robot.measure().at_rest
        run(robot, moving, 50)
        assert list(robot.positions()) == pytest.approx(list(before), abs=1e-3)
        robot.reset()
        run(robot, moving, 50)
        assert not robot.measure().at_rest
    finally:
        robot.close()


def motion(robot: Robot) -> Iterator[list[float]]:
    """Yield values for tick after tick: half of each rate, and a first goal axis that goes on and on."""
    axes = robot.describe().axes
    goals = list(robot.goals())
    first = next((number for number, axis in enumerate(axes) if axis.kind == "goal"), None)
    while True:
        yield [
            goals[number] if axis.kind == "goal" else (axis.rest + axis.maximum) / 2 for number, axis in enumerate(axes)
        ]
        if first is not None:
            goals[first] += axes[first].slew * robot.tick_seconds / 2


def run(robot: Robot, values: Iterator[list[float]], ticks: int) -> None:
    for _ in range(ticks):
        robot.apply(next(values))
        robot.tick()
