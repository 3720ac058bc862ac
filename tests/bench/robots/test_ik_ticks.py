"""Ticks of a robot whose tool is driven."""

from pathlib import Path

from lockstep.bench.robots.ik_ticks import tick_times
from lockstep.robot_bridge.robots.mjcf import create
from tests.robot_bridge.robots.mjcf.models import model_file
from tests.robot_bridge.robots.mjcf.tools.arms import arm_model


def test_a_driven_tool_moves_and_one_that_rests_does_not(tmp_path: Path) -> None:
    robot = create(model_file(tmp_path, arm_model()))
    try:
        begun = list(robot.goals())
        driven = tick_times(robot, 60)
        assert len(driven.until_feedback) == len(driven.ahead) == 60
        assert list(robot.goals()) != begun
        tick_times(robot, 100, driven=False)
        still = list(robot.goals())
        tick_times(robot, 60, driven=False)
        assert list(robot.goals()) == still
    finally:
        robot.close()
