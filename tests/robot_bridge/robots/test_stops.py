"""The stop of each robot that needs nothing but this machine's processor: nothing applied moves it until the reset."""

from collections.abc import Callable
from pathlib import Path

import pytest

from lockstep.robot_bridge.errors import RobotUnavailable
from lockstep.robot_bridge.robots.base import Robot
from lockstep.robot_bridge.robots.registry import create_robot

MODEL = Path(__file__).parents[3] / "docs" / "examples" / "mjcf" / "desk_arm.xml"


def mjcf() -> Robot:
    from lockstep.robot_bridge.robots.mjcf import create

    return create(MODEL)


@pytest.mark.parametrize(
    "make",
    [
        lambda: create_robot("planar"),
        lambda: create_robot("micromanipulator"),
        lambda: create_robot("mobile-manipulator"),
        mjcf,
    ],
    ids=["planar", "micromanipulator", "mobile-manipulator", "mjcf"],
)
def test_a_stopped_robot_stands_whatever_is_applied_until_it_is_reset(make: Callable[[], Robot]) -> None:
    try:
        robot = make()
    except RobotUnavailable as error:
        pytest.skip(str(error))
    try:
        axes = robot.describe().axes
        moving = [(axis.rest + axis.maximum) / 2 for axis in axes]
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


def run(robot: Robot, values: list[float], ticks: int) -> None:
    for _ in range(ticks):
        robot.apply(values)
        robot.tick()
