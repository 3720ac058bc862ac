"""The thread between the bridge and a robot that may take its time."""

import math
import threading
import time

import pytest

from lockstep.robot_bridge.robots.lerobot.bus_loop import BusLoop
from tests.robot_bridge.robots.lerobot.fake_device import FakeDevice

NAMES = ("pan.pos", "gripper.pos")


def loop_of(device: FakeDevice, *, torque_off: bool = False) -> BusLoop:
    return BusLoop(device, NAMES, rate=200, still=1.0, torque_off_at_end=torque_off)


def test_it_reads_before_it_runs_and_sends_nothing_that_nobody_wanted() -> None:
    device = FakeDevice(at=7.0)
    bus = loop_of(device)
    bus.start()
    assert bus.newest is not None
    assert bus.newest.values == (7.0, 7.0)
    device.wait("observe", None, after=3)
    bus.close()
    assert device.made("act") == []
    assert device.made("disconnect") == [False]


def test_a_robot_that_cannot_be_read_does_not_start() -> None:
    device = FakeDevice()

    def fail() -> None:
        raise ConnectionError("no status packet")

    device.on_observe = fail
    bus = loop_of(device)
    with pytest.raises(ConnectionError):
        bus.start()
    bus.close()
    assert device.made("disconnect") == [False]


def test_the_newest_goals_win_while_a_call_blocks() -> None:
    device, go, arrived = FakeDevice(), threading.Event(), threading.Event()
    bus = loop_of(device)

    def block() -> None:
        arrived.set()
        assert go.wait(10)

    device.on_act = block
    bus.start()
    bus.want([1.0, 1.0])
    assert arrived.wait(10)
    for value in (2.0, 3.0, 4.0):
        bus.want([value, value])  # returns at once
    assert bus.held_up(time.monotonic() + 5.0) >= 5.0
    go.set()
    device.wait("act", {"pan.pos": 4.0, "gripper.pos": 4.0})
    bus.close()
    assert [action["pan.pos"] for action in device.made("act")][:2] == [1.0, 4.0]


def test_it_sends_the_last_goals_once_more_at_its_end() -> None:
    device = FakeDevice()
    bus = loop_of(device)
    bus.start()
    bus.want([5.0, 6.0])
    bus.close()
    assert device.made("act")[-1] == {"pan.pos": 5.0, "gripper.pos": 6.0}
    assert device.calls[-1] == ("disconnect", False)


def test_a_goal_that_cannot_be_sent_ends_it() -> None:
    device = FakeDevice()
    bus = loop_of(device)
    bus.start()
    ended = threading.Event()

    def fail() -> None:
        ended.set()
        raise ConnectionError("unplugged")

    device.on_act = fail
    bus.want([1.0, 1.0])
    assert ended.wait(10)
    bus.close()
    assert isinstance(bus.failure, ConnectionError)


def test_a_reading_that_fails_is_a_fault_and_the_state_grows_old() -> None:
    device = FakeDevice()
    bus = loop_of(device)
    bus.start()
    before = bus.newest
    failed = threading.Event()

    def fail() -> None:
        failed.set()
        raise ConnectionError("no status packet")

    device.on_observe = fail
    assert failed.wait(10)
    bus.close()
    assert bus.failure is None
    assert "ConnectionError: no status packet" in bus.faults(time.monotonic())[0]
    assert bus.faults(time.monotonic() + 60) == []
    assert before is not None


def test_a_value_that_is_missing_or_no_number_is_unknown_and_not_still() -> None:
    device = FakeDevice()
    device.places = {"pan.pos": "broken"}
    bus = loop_of(device)
    bus.start()
    bus.close()
    assert bus.newest is not None
    assert all(map(math.isnan, bus.newest.values))
    assert not bus.newest.at_rest


def test_motors_that_are_switched_on_are_told_first_to_be_where_they_are() -> None:
    device = FakeDevice()
    bus = loop_of(device)
    bus.start()
    bus.want([10.0, 10.0])
    seen = device.wait("act", {"pan.pos": 10.0, "gripper.pos": 10.0})
    bus.switch_torque(False)
    seen = device.wait("torque", False, after=seen)
    device.places = {"pan.pos": -40.0, "gripper.pos": 3.0}  # it fell
    bus.switch_torque(True)
    seen = device.wait("torque", True, after=seen)
    bus.close()
    after = device.calls[device.calls.index(("torque", False)) :]
    assert [value for call, value in after if call == "act"] == [{"pan.pos": -40.0, "gripper.pos": 3.0}]
    assert after.index(("act", {"pan.pos": -40.0, "gripper.pos": 3.0})) < after.index(("torque", True))


def test_nothing_is_sent_to_motors_without_torque() -> None:
    device = FakeDevice()
    bus = loop_of(device)
    bus.start()
    bus.switch_torque(False)
    seen = device.wait("torque", False)
    bus.want([10.0, 10.0])
    device.wait("observe", None, after=seen + 5)
    bus.close()
    assert device.made("act") == []


def test_the_torque_goes_at_the_end_where_that_is_wanted() -> None:
    device = FakeDevice()
    bus = loop_of(device, torque_off=True)
    bus.start()
    bus.close()
    bus.close()
    assert device.made("disconnect") == [True]
