"""Position limits and geofences over the real bridge: they act, are fed back, counted and recorded."""

import contextlib
import math
from collections.abc import Sequence
from pathlib import Path

from lockstep.robot_bridge.robots.planar.description import RADIUS
from lockstep.robot_bridge.robots.planar.robot import PlanarState
from lockstep.robot_bridge.robots.planar.room import CHARGER
from tests.robot_bridge.bridge_helpers import NEUTRAL, RecordingRobot, log_lines, operator, running_bridge

FAST = 0.2  # m/s


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


class Lost(RecordingRobot):
    """Does not know where it is while `lost`."""

    def __init__(self) -> None:
        super().__init__()
        self.lost = True

    def positions(self) -> Sequence[float]:
        return [math.nan] * 3 if self.lost else super().positions()


async def test_a_robot_that_does_not_know_where_it_is_does_not_move_and_says_so() -> None:
    robot = Lost()
    async with running_bridge(robot) as bridge, operator(bridge) as driver:
        driver.link.send(driver.command([0.8, 0.8, 0.0]))
        await driver.heard(lambda feedback: feedback.neutral_needed)
        assert driver.feedback.faults == ["came to rest: the position is unknown (charger, room)"]
        assert driver.feedback.limits == ["charger", "room"]
    assert (robot.state.x, robot.state.y) == (0.0, 0.0)


async def test_a_deadman_that_is_held_until_the_position_is_known_again_moves_nothing() -> None:
    robot = Lost()
    robot.lost = False
    async with running_bridge(robot) as bridge, operator(bridge) as driver:
        while robot.state.vx < FAST:
            await driver.drive()
        robot.lost = True
        with contextlib.suppress(AssertionError):
            driver.link.send(driver.command())
            await driver.heard(lambda feedback: feedback.neutral_needed)
        await robot.until(lambda: robot.applied[-1][1] == NEUTRAL, "the robot rests")
        robot.lost = False
        known = len(robot.applied)
        for _ in range(3):
            assert (await driver.refused(driver.command())).reason == "not_neutral"
        await driver.heard(lambda feedback: feedback.at_rest)
        assert all(values == NEUTRAL for _, values in robot.applied[known:])
        await driver.arm()
        while robot.state.vx < FAST:
            await driver.drive()
        assert driver.feedback.faults == []


async def test_a_robot_whose_position_stays_unknown_wants_a_neutral_command_after_each_try() -> None:
    robot = Lost()
    async with running_bridge(robot) as bridge, operator(bridge) as driver:
        for _ in range(3):
            driver.link.send(driver.command())
            await driver.heard(lambda feedback: feedback.neutral_needed)
            await driver.arm()
    assert robot.state.vx == 0.0


async def test_what_needs_no_position_goes_on_without_one() -> None:
    """Turning on the spot leads across no geofence."""
    robot = Lost()
    async with running_bridge(robot) as bridge, operator(bridge) as driver:
        for _ in range(3):
            feedback = await driver.drive([0.0, 0.0, 0.5])
            assert not feedback.neutral_needed
    assert robot.state.yaw > 0.0
