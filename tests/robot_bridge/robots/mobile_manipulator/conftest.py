from collections.abc import Iterator

import pytest

from lockstep.robot_bridge.robots.mobile_manipulator import create
from lockstep.robot_bridge.robots.mobile_manipulator.robot import MobileManipulator
from tests.robot_bridge.robots.mobile_manipulator.driver import Driver


@pytest.fixture
def robot() -> Iterator[MobileManipulator]:
    robot = create()
    if not isinstance(robot, MobileManipulator):
        raise TypeError(robot)
    yield robot
    robot.close()


@pytest.fixture
def driver(robot: MobileManipulator) -> Driver:
    return Driver(robot)
