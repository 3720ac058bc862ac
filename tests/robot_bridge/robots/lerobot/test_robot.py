"""A robot of LeRobot as the bridge calls it, over a device of the tests."""

import math
import threading
import time
from collections.abc import Iterator

import pytest

from lockstep.robot_bridge.control.limits.axis_shaper import AxisShaper
from lockstep.robot_bridge.errors import RobotUnavailable, SettingsError
from lockstep.robot_bridge.robots.base import Measurement, Robot
from lockstep.robot_bridge.robots.lerobot import drive
from lockstep.robot_bridge.robots.lerobot import robot as robot_module
from lockstep.robot_bridge.robots.lerobot.settings import AxisSettings, LeRobotSettings
from tests.robot_bridge.robots.lerobot.fake_device import GRIPPER, PAN, WHEEL, FakeDevice

FAST = LeRobotSettings(rate=200)


@pytest.fixture
def robots() -> Iterator[list[Robot]]:
    made: list[Robot] = []
    yield made
    for robot in made:
        robot.close()


def make(robots: list[Robot], device: FakeDevice, settings: LeRobotSettings = FAST) -> Robot:
    robots.append(drive(device, settings))
    return robots[-1]


def until_unknown(robot: Robot) -> Measurement:
    """Wait until the newest reading is too old; it grows old by itself."""
    for _ in range(5000):
        measured = robot.measure()
        if all(map(math.isnan, measured.axes)):
            break
        time.sleep(0.001)
    return measured


def until_measured(robot: Robot, axes: list[float]) -> None:
    """Wait until the thread has read these places."""
    for _ in range(5000):
        if robot.measured_axes() == axes:
            return
        time.sleep(0.001)
    raise AssertionError(f"{robot.measured_axes()} is not {axes}")


def tick_on(robot: Robot) -> None:
    for _ in range(5000):
        robot.tick()
        time.sleep(0.001)  # the thread ends some time after its call


def test_it_measures_degrees_and_has_their_joints_in_radians(robots: list[Robot]) -> None:
    robot = make(robots, FakeDevice(at=90.0))
    assert robot.measured_axes() == [90.0, 90.0]
    measured = robot.measure()
    assert measured.joints == [pytest.approx(math.pi / 2)]
    assert measured.faults == []
    assert robot.positions() == measured.joints


def test_the_motors_are_told_at_first_to_be_where_they_are(robots: list[Robot]) -> None:
    device = FakeDevice(PAN, WHEEL, at=30.0)
    make(robots, device)
    device.wait("act", {"pan.pos": 30.0, "x.vel": 0.0})
    assert device.made("act")[0] == {"pan.pos": 30.0, "x.vel": 0.0}


def test_a_new_bridge_forgets_the_goals_from_before_so_a_gripper_squeezes_no_more(robots: list[Robot]) -> None:
    device = FakeDevice()
    device.yields = {"pan.pos": -4.0, "gripper.pos": 15.0}
    device.act({"pan.pos": 10.0, "gripper.pos": 5.0})  # by the bridge before: the arm hangs, and a block is held
    device.yields = {}
    robot = make(robots, device)
    assert robot.goals() == pytest.approx((6.0, 20.0))
    device.wait("act", {"pan.pos": 6.0, "gripper.pos": 20.0})


def test_the_applied_goals_reach_the_device_under_its_own_names(robots: list[Robot]) -> None:
    device = FakeDevice()
    robot = make(robots, device)
    robot.apply([1.5, 20.0])
    device.wait("act", {"pan.pos": 1.5, "gripper.pos": 20.0})


def test_a_stop_holds_the_goals_and_no_value_moves_the_robot_until_its_reset(robots: list[Robot]) -> None:
    device = FakeDevice(PAN, WHEEL)
    robot = make(robots, device)
    robot.apply([10.0, 0.2])
    seen = device.wait("act", {"pan.pos": 10.0, "x.vel": 0.2})
    robot.stop()
    robot.apply([50.0, 0.3])
    seen = device.wait("act", {"pan.pos": 10.0, "x.vel": 0.0}, after=seen)
    device.wait("observe", None, after=seen + 4)
    assert {"pan.pos": 50.0, "x.vel": 0.3} not in device.made("act")
    assert device.made("torque") == []
    robot.reset()
    robot.apply([11.0, 0.0])
    device.wait("act", {"pan.pos": 11.0, "x.vel": 0.0}, after=seen)


def test_a_stop_and_its_reset_keep_the_grip_and_hold_a_loaded_arm_where_it_was(robots: list[Robot]) -> None:
    """The motors hang below their goals, or a block keeps the jaws from theirs: both goals stay what they were."""
    device = FakeDevice(at=30.0)
    robot = make(robots, device)
    assert robot.goals() == pytest.approx((30.0, 30.0))  # told at the start to be where they are
    device.yields = {"pan.pos": -4.0, "gripper.pos": 15.0}
    robot.apply([10.0, 5.0])
    seen = device.wait("act", {"pan.pos": 10.0, "gripper.pos": 5.0})
    device.wait("observe", None, after=seen)
    shaper = AxisShaper(robot.describe().axes, hold=0.5)
    robot.stop()
    robot.reset()
    until_measured(robot, [6.0, 20.0])
    assert shaper.begin(robot.measured_axes(), robot.goals())
    assert shaper.goals == [10.0, 5.0]


def test_motors_that_had_no_torque_have_no_goal_from_before(robots: list[Robot]) -> None:
    device = FakeDevice()
    robot = make(robots, device, LeRobotSettings(rate=200, stop="torque_off"))
    robot.apply([10.0, 10.0])
    seen = device.wait("act", {"pan.pos": 10.0, "gripper.pos": 10.0})
    robot.stop()
    seen = device.wait("torque", False, after=seen)
    device.places["pan.pos"] = -30.0
    robot.reset()
    device.wait("torque", True, after=seen)
    until_measured(robot, [-30.0, 10.0])
    assert robot.goals() == [-30.0, 10.0]


def test_a_stop_takes_the_torque_only_where_the_settings_say_so(robots: list[Robot]) -> None:
    device = FakeDevice()
    robot = make(robots, device, LeRobotSettings(rate=200, stop="torque_off"))
    robot.apply([10.0, 10.0])
    seen = device.wait("act", {"pan.pos": 10.0, "gripper.pos": 10.0})
    robot.stop()
    seen = device.wait("torque", False, after=seen)
    device.places["pan.pos"] = -30.0
    robot.reset()
    device.wait("torque", True, after=seen)
    assert [action["pan.pos"] for action in device.made("act")][-1] == -30.0


def test_the_watchdog_keeps_goals_and_ends_rates(robots: list[Robot]) -> None:
    device = FakeDevice(PAN, WHEEL)
    robot = make(robots, device)
    robot.apply([10.0, 0.2])
    seen = device.wait("act", {"pan.pos": 10.0, "x.vel": 0.2})
    robot.rest_from_thread()
    device.wait("act", {"pan.pos": 10.0, "x.vel": 0.0}, after=seen)


def test_a_device_that_fails_ends_the_tick(robots: list[Robot]) -> None:
    device = FakeDevice()
    robot = make(robots, device)
    robot.tick()
    ended = threading.Event()

    def fail() -> None:
        ended.set()
        raise ConnectionError("unplugged")

    device.on_act = fail
    robot.apply([1.0, 1.0])
    assert ended.wait(10)
    with pytest.raises(ConnectionError, match="unplugged"):
        tick_on(robot)


def test_a_device_that_hangs_makes_the_state_unknown_and_then_ends_the_tick(
    robots: list[Robot], monkeypatch: pytest.MonkeyPatch
) -> None:
    device, go, arrived = FakeDevice(), threading.Event(), threading.Event()
    robot = make(robots, device, LeRobotSettings(rate=200, timeout=0.05))

    def hang() -> None:
        arrived.set()
        assert go.wait(20)

    device.on_act = hang
    robot.apply([1.0, 1.0])
    assert arrived.wait(10)
    try:
        measured = until_unknown(robot)
        assert all(map(math.isnan, measured.axes))
        assert any("no reading for" in fault for fault in measured.faults)
        assert not measured.at_rest
        monkeypatch.setattr(robot_module, "HUNG_SECONDS", 0.05)
        with pytest.raises(TimeoutError, match="has not answered"):
            tick_on(robot)
    finally:
        go.set()


def test_settings_that_contradict_themselves_let_the_device_go() -> None:
    device = FakeDevice()
    with pytest.raises(SettingsError):
        drive(device, LeRobotSettings(axes={"pan.pos": AxisSettings(minimum=10.0, maximum=-10.0)}))
    assert device.made("disconnect") == [False]


def test_a_device_that_cannot_be_read_is_let_go() -> None:
    device = FakeDevice(PAN, GRIPPER)

    def fail() -> None:
        raise ConnectionError("no status packet")

    device.on_observe = fail
    with pytest.raises(RobotUnavailable, match="no status packet"):
        drive(device, FAST)
    assert device.made("disconnect") == [False]
