"""Position limits and geofences over the real bridge: they act, are fed back, counted and recorded."""

import math
from pathlib import Path

from robot_bridge.robots.planar.description import RADIUS
from robot_bridge.robots.planar.robot import PlanarState
from robot_bridge.robots.planar.room import CHARGER
from tests.robot_bridge.bridge_helpers import RecordingRobot, log_lines, operator, running_bridge


async def test_a_geofence_stops_the_robot_and_is_fed_back_counted_and_recorded(tmp_path: Path) -> None:
    left, low, _, high = CHARGER
    robot = RecordingRobot(state=PlanarState(x=left - RADIUS - 0.05, y=(low + high) / 2))
    async with running_bridge(robot, event_log=tmp_path / "log") as bridge, operator(bridge) as driver:
        while "charger" not in driver.feedback.limits:
            await driver.drive([0.8, 0.0, 0.0])
        await driver.drive([0.8, 0.0, 0.0])
        assert robot.state.x + RADIUS <= left + 1e-9
        assert bridge.counters.limits == {"charger": 1}
        await driver.drive([-0.8, 0.0, 0.0])
        await driver.heard(lambda feedback: not feedback.limits)
    assert [line["acting"] for line in log_lines(tmp_path / "log", "limit")][:1] == [["charger"]]


async def test_a_robot_that_does_not_know_where_it_is_does_not_move_and_says_so() -> None:
    class Lost(RecordingRobot):
        def positions(self) -> list[float]:
            return [math.nan] * 3

    robot = Lost()
    async with running_bridge(robot) as bridge, operator(bridge) as driver:
        await driver.drive([0.8, 0.8, 0.0])
        feedback = await driver.drive([0.8, 0.8, 0.0])
    assert feedback.limits == ["charger", "room"]
    assert "no motion: the position is unknown (room)" in feedback.faults
    assert (robot.state.x, robot.state.y) == (0.0, 0.0)
