"""A tick that begins on a command: at once, once in each period, and never before a stop that came with the command."""

import asyncio

import msgspec
import pytest

from lockstep.protocol.description import RobotDescription
from lockstep.protocol.messages import Command, Rest, Stop
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.errors import DescriptionError
from lockstep.robot_bridge.settings import BridgeSettings
from tests.robot_bridge.bridge_helpers import DRIVE, NEUTRAL, RecordingRobot, operator, running_bridge

PERIOD = 2.0  # s; a tick much sooner than that after the one before began on something that arrived


class SlowRobot(RecordingRobot):
    """Ticks every `PERIOD`, or on a command."""

    tick_seconds = PERIOD

    def describe(self) -> RobotDescription:
        return msgspec.structs.replace(super().describe(), hold=5.0, watchdog=4.9)


class PatientRobot(RecordingRobot):
    ticks_on_command = False


class Hasty(RecordingRobot):
    """Its watchdog is longer than a period, and shorter than two."""

    tick_seconds = 0.15

    def describe(self) -> RobotDescription:
        return msgspec.structs.replace(super().describe(), hold=1.0, watchdog=0.2)


class HastyAtItsBeats(Hasty):
    ticks_on_command = False


def test_a_watchdog_is_longer_than_two_ticks_may_lie_apart() -> None:
    settings = BridgeSettings(port=0)
    with pytest.raises(DescriptionError, match=r"watchdog must be longer than the 0\.3 s"):
        Bridge(Hasty(), settings)
    Bridge(HastyAtItsBeats(), settings)


async def test_a_command_does_not_wait_for_the_beat_and_those_after_it_make_no_further_tick_in_its_period() -> None:
    robot = SlowRobot()
    async with running_bridge(robot) as bridge, operator(bridge, armed=False) as driver:
        ticks = len(robot.applied)  # the first feedback came with the last of them, so a period has just begun
        async with asyncio.timeout(PERIOD / 2):
            await driver.drive(NEUTRAL)
        assert len(robot.applied) == ticks + 1
        event = driver.feedback.event
        for _ in range(200):
            driver.link.send(driver.command(DRIVE))
            driver.link.send(Rest(event=event))
        await driver.refused(Command(event=event + 1, issue=1, values=[]))
        assert bridge.counters.executed >= 2
        assert len(robot.applied) == ticks + 1


async def test_a_robot_that_does_not_allow_it_is_driven_at_its_beats() -> None:
    robot = PatientRobot()
    async with running_bridge(robot) as bridge, operator(bridge) as driver:
        for _ in range(10):
            await driver.drive()
        assert robot.state.vx > 0.0


async def test_a_stop_that_comes_together_with_a_command_comes_before_its_tick() -> None:
    robot = RecordingRobot()
    async with running_bridge(robot) as bridge, operator(bridge) as driver:
        applied = len(robot.applied)
        driver.link.send(driver.command(DRIVE))
        driver.link.send(Stop(press="press", by="a person", reason="stop key"))
        await driver.heard(lambda feedback: feedback.stop.stopped)
        assert all(values == NEUTRAL for _, values in robot.applied[applied:])
        assert bridge.counters.executed == 2, "the command came first"


async def test_ticks_are_no_more_than_their_periods_while_every_feedback_is_answered_at_once() -> None:
    robot = RecordingRobot()
    async with running_bridge(robot) as bridge, operator(bridge) as driver:
        first = robot.applied[-1][0]
        ticks = len(robot.applied)
        for _ in range(100):
            await driver.drive()
        periods = (robot.applied[-1][0] - first) / robot.tick_seconds
        assert len(robot.applied) - ticks <= periods + 2
