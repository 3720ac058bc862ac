import subprocess
import sys

import pytest

from lockstep.robot_bridge.errors import UnknownRobot
from lockstep.robot_bridge.robots.planar import PlanarRobot
from lockstep.robot_bridge.robots.registry import create_robot, robot_names


def test_a_robot_is_created_by_name() -> None:
    assert isinstance(create_robot("planar"), PlanarRobot)
    assert {"planar", "mobile-manipulator"} <= set(robot_names())


def test_an_unknown_name_is_an_error_that_lists_the_known_ones() -> None:
    with pytest.raises(UnknownRobot, match="planar"):
        create_robot("tractor")


def test_asking_for_one_robot_imports_no_other() -> None:
    code = (
        "import sys; from lockstep.robot_bridge.robots.registry import create_robot; create_robot('planar');"
        "sys.exit('mujoco' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
