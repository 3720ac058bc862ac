from collections.abc import Iterator
from pathlib import Path

import pytest

from lockstep.robot_bridge.errors import RobotUnavailable
from lockstep.robot_bridge.robots.so101.model_source import FOLDER_VARIABLE, arm_file
from lockstep.robot_bridge.robots.so101.robot import So101
from tests.robot_bridge.robots.so101.driver import MODEL_FOLDER, ArmDriver


@pytest.fixture(scope="session")
def so101_file() -> Path:
    """The arm's MJCF file."""
    if not (MODEL_FOLDER / ".installed").is_file():
        pytest.skip("the model of the SO-101 is not here; `make test` fetches it")
    return arm_file({FOLDER_VARIABLE: str(MODEL_FOLDER)})


@pytest.fixture
def robot(so101_file: Path) -> Iterator[So101]:
    try:
        robot = So101(so101_file)
    except RobotUnavailable as error:
        pytest.skip(str(error))
    yield robot
    robot.close()


@pytest.fixture
def arm(robot: So101) -> ArmDriver:
    return ArmDriver(robot)
