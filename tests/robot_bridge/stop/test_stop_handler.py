"""How stops and resets reach the robot and its clients."""

from typing import cast

import pytest

from lockstep.protocol.messages import LinkMessage, Refusal, Reset, Stop
from lockstep.robot_bridge.control.event_core import EventCore
from lockstep.robot_bridge.control.limits.axis_shaper import AxisShaper
from lockstep.robot_bridge.counters import BridgeCounters
from lockstep.robot_bridge.event_log import EventLog
from lockstep.robot_bridge.link.link_transport import LinkTransport
from lockstep.robot_bridge.link.refusals import Refusals
from lockstep.robot_bridge.robots.planar.robot import PlanarRobot
from lockstep.robot_bridge.stop.stop_handler import StopHandler
from lockstep.robot_bridge.stop.stop_keeper import StopKeeper


class Client:
    def __init__(self) -> None:
        self.heard: list[LinkMessage] = []

    def send(self, message: LinkMessage) -> None:
        self.heard.append(message)


class Robot(PlanarRobot):
    def __init__(self) -> None:
        super().__init__()
        self.calls: list[str] = []
        self.broken = False
        self.lock = ""

    def stop(self) -> None:
        self.calls.append("stop")

    def reset(self) -> None:
        if self.broken:
            raise OSError("broken")
        self.calls.append("reset")

    def locked_out(self) -> str:
        return self.lock


class Rig:
    """A handler on a clock that the test sets, with a latch in memory."""

    def __init__(self) -> None:
        self.now = 0.0
        self.robot = Robot()
        description = self.robot.describe()
        log = EventLog(None)
        self.counters = BridgeCounters()
        self.core = EventCore(description.axes, max_event_age=description.max_event_age)
        self.shaper = AxisShaper(description.axes, hold=description.hold)
        refusals = Refusals(self.counters, log)
        keeper = StopKeeper(None)
        self.stops = StopHandler(self.robot, self.core, self.shaper, keeper, None, refusals, log, lambda: self.now)
        self.client = Client()
        self.stops.begin()

    @property
    def peer(self) -> LinkTransport:
        return cast(LinkTransport, self.client)

    def press(self) -> int:
        self.shaper.drive([0.4, 0.0, 0.0], self.now)
        self.shaper.step(self.now, 0.1)
        self.stops.stop(self.peer, Stop(by="ann", reason="seen", press=f"press at {self.now}"))
        return self.core.stops.state.number

    def reset(self, number: int) -> None:
        for _ in range(20):  # a stop is released only when feedback has shown it for a while
            self.now += 0.1
            self.core.issue(self.robot.measure(), self.now)
        self.stops.reset(self.peer, Reset(by="ann", number=number))


async def test_the_robots_own_stop_follows_once_when_the_axes_are_at_rest() -> None:
    rig = Rig()
    rig.press()
    assert rig.robot.calls == []
    rig.stops.rests()
    rig.stops.rests()
    assert rig.robot.calls == ["stop"]


async def test_a_reset_reaches_a_robot_that_was_told_to_stop_and_no_other() -> None:
    rig = Rig()
    rig.reset(rig.press())
    rig.stops.rests()
    assert rig.robot.calls == []
    number = rig.press()
    rig.stops.rests()
    rig.reset(number)
    assert rig.robot.calls == ["stop", "reset"]


async def test_a_reset_that_the_robot_does_not_take_ends_the_next_tick() -> None:
    rig = Rig()
    number = rig.press()
    rig.stops.rests()
    rig.robot.broken = True
    rig.reset(number)
    with pytest.raises(OSError, match="broken"):
        rig.stops.look(rig.now)


async def test_a_reset_of_another_stop_is_refused_and_counted() -> None:
    rig = Rig()
    rig.reset(rig.press() + 1)
    [*_, refused] = rig.client.heard
    assert isinstance(refused, Refusal)
    assert rig.counters.refusals == {refused.reason: 1}
    assert rig.core.stops.state.stopped


async def test_a_lock_at_the_robot_stops_it() -> None:
    rig = Rig()
    rig.robot.lock = "the key switch"
    rig.stops.look(rig.now)
    assert (rig.core.stops.state.stopped, rig.core.stops.state.locked_out) == (True, "the key switch")
    rig.robot.lock = ""
    rig.stops.look(rig.now)
    assert (rig.core.stops.state.stopped, rig.core.stops.state.locked_out) == (True, "")


async def test_only_the_first_failure_counts() -> None:
    rig = Rig()
    rig.stops.fail(OSError("first"))
    rig.stops.fail(OSError("second"))
    assert rig.stops.failure == "robot failed: OSError: first"
    assert rig.core.stops.state.reason == rig.stops.failure
