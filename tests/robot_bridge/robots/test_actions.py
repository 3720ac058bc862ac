"""The actions of the simulated robots do what their names say."""

import asyncio
import importlib.util
import math

import pytest

from lockstep.robot_bridge.robots.actions import ActionFailed, ActionStep
from lockstep.robot_bridge.robots.base import Robot
from lockstep.robot_bridge.robots.micromanipulator.robot import Micromanipulator
from lockstep.robot_bridge.robots.planar.robot import PlanarRobot, PlanarState
from lockstep.robot_bridge.robots.planar.room import DOCK, PILLARS
from lockstep.robot_bridge.robots.simulated_battery import SimulatedBattery

MOST = 30.0  # s of simulated time


def run(robot: Robot, name: str) -> ActionStep:
    """Let an action run to its end, as a bridge without limits does."""
    action = robot.begin_action(name, {})
    rest = [axis.rest for axis in robot.describe().axes]
    shares = []
    for _ in range(round(MOST / robot.tick_seconds)):
        step = action.step()
        shares.append(step.progress)
        if step.done:
            assert all(0 <= share <= 1 for share in shares)
            return step
        robot.apply(rest if step.values is None else [value for value in step.values if value is not None])
        robot.tick()
    raise AssertionError(f"{name} does not end")


async def drawn(robot: Micromanipulator, event: int) -> None:
    """Let the microscope take a picture now."""
    picture = robot._draw_microscope(robot.state(), event)
    assert not isinstance(picture, bytes)
    await picture


def test_planar_home_drives_to_the_place_where_the_robot_began() -> None:
    robot = PlanarRobot()
    robot._state = PlanarState(x=0.6, y=-0.3, yaw=2.0)
    assert run(robot, "home").text == "at home"
    assert max(map(abs, robot.state[:3])) < 0.03


def test_planar_home_gives_up_when_a_pillar_is_in_the_way() -> None:
    robot = PlanarRobot(PlanarState(x=-1.8, y=-1.0))
    robot._state = PlanarState(x=0.0, y=0.0)
    robot._home = (-1.8, -1.0, 0.0)
    with pytest.raises(ActionFailed, match="in the way"):
        run(robot, "home")


def test_planar_dock_drives_to_the_charging_corner_and_charges_there() -> None:
    robot = PlanarRobot()
    robot._battery = SimulatedBattery(0.1)
    assert run(robot, "dock").text == "at the charger"
    assert math.dist(robot.state[:2], DOCK[:2]) < 0.03
    arrived = robot.status()[0]
    assert isinstance(arrived.value, float)
    assert arrived.value < 0.1
    for _ in range(round(60 / robot.tick_seconds)):
        robot.apply([0.0, 0.0, 0.0])
        robot.tick()
    charged = robot.status()[0]
    assert charged.value == pytest.approx(arrived.value + 60 / (20 * 60), abs=0.002)
    assert (charged.level, charged.text) == ("warning", "it is charging")


def test_planar_dock_fails_when_there_is_no_way_to_it() -> None:
    x, y, radius = PILLARS[1].tolist()
    robot = PlanarRobot(PlanarState(x=x + radius - 0.3, y=y))  # it stands in the pillar
    with pytest.raises(ActionFailed, match="no way"):
        run(robot, "dock")


def test_autofocus_finds_the_height_of_the_tip_and_a_snapshot_names_its_picture() -> None:
    robot = Micromanipulator()
    try:
        assert "sharp at" in run(robot, "autofocus").text
        state = robot.state()
        assert abs(state.focus - state.tip[2]) < 1e-6
        snapshot = robot.begin_action("snapshot", {})
        assert not snapshot.step().done
        asyncio.run(drawn(robot, 7))
        assert snapshot.step().text == f"picture of event 7, focus {state.focus * 1e6:.1f} µm; only recordings keep it"
        assert robot.status()[1].value == 1.0
    finally:
        robot.close()


@pytest.mark.skipif(importlib.util.find_spec("mujoco") is None, reason="needs MuJoCo")
def test_the_arm_goes_home_and_stays_where_it_is_when_cancelled() -> None:
    from lockstep.robot_bridge.robots.mobile_manipulator.arm_drive import ArmDrive
    from lockstep.robot_bridge.robots.mobile_manipulator.robot import MobileManipulator

    robot = MobileManipulator()
    try:
        assert isinstance(robot._arm, ArmDrive)
        lift = [0.0] * 5 + [0.2] + [0.0] * 3
        for _ in range(400):
            robot.apply(lift)
            robot.tick()
        away = sum(robot._arm.from_home())
        assert away > 0.2
        begun = robot.begin_action("home", {})
        for _ in range(50):
            begun.step()
            robot.apply([0.0] * 9)
            robot.tick()
        begun.cancel()
        halfway = robot.positions()
        for _ in range(200):
            robot.apply([0.0] * 9)
            robot.tick()
        assert sum(robot._arm.from_home()) > 0.05
        assert max(abs(a - b) for a, b in zip(halfway, robot.positions(), strict=True)) < 0.1
        run(robot, "home")
        assert max(robot._arm.from_home()) < 0.03
    finally:
        robot.close()


def test_a_battery_warns_before_it_is_empty() -> None:
    battery = SimulatedBattery(0.21)
    assert battery.item().level == "ok"
    battery.tick(3 * 3600 * 0.02, moving=False)
    assert (battery.item().level, battery.item().text) == ("warning", "charge it soon")
    battery.tick(3 * 3600 * 0.15, moving=False)
    assert battery.item().level == "error"
    battery.tick(3 * 3600 * 0.05, moving=False)
    assert battery.item().value == 1.0


def test_a_battery_at_a_charger_fills_up_and_is_never_more_than_full() -> None:
    battery = SimulatedBattery(0.1)
    battery.tick(60.0, moving=False, charging=True)
    assert battery.item().value == pytest.approx(0.15)
    assert battery.item().text == "it is charging"
    battery.tick(3600.0, moving=False, charging=True)
    assert (battery.item().value, battery.item().text) == (1.0, "")
    battery.tick(3 * 3600 * 0.85, moving=False)
    assert battery.item().text == "charge it soon"
