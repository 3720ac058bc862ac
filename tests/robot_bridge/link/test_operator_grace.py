"""Two consoles at one bridge: a stall of the first does not give the robot to the second; its goodbye does."""

import asyncio

import pytest

from lockstep.protocol.errors import LinkLost, LinkRefused
from lockstep.protocol.messages import Feedback, Hello, Stop
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.link.link_client import RobotLink
from lockstep.robot_bridge.settings import BridgeSettings
from tests.robot_bridge.bridge_helpers import Operator, RecordingRobot, raw_link


def bridge_with(grace: float) -> Bridge:
    return Bridge(RecordingRobot(), BridgeSettings(port=0, operator_grace=grace))


async def lose_a_link(bridge: Bridge, name: str) -> None:
    """A console that was admitted and falls silent."""
    async with raw_link(bridge) as link:
        link.send(Hello(role="operator", name=name))
        await link.find(Hello)
        while await link.next() is not None:  # until the bridge takes it for dead
            pass


async def test_another_console_does_not_get_the_robot_of_one_that_is_held_up() -> None:
    async with bridge_with(60.0) as bridge:
        await lose_a_link(bridge, "first")
        with pytest.raises(LinkRefused, match="taken: kept for first, whose link broke"):
            await RobotLink(*bridge.address, "operator", name="second").connect()
        async with RobotLink(*bridge.address, "media", name="second") as watcher:
            watcher.send(Stop(reason="smoke"))
            async with RobotLink(*bridge.address, "operator", name="first") as link:
                driver = Operator(link)
                await driver.next(Feedback)
                await driver.heard(lambda feedback: feedback.stop.stopped)


async def test_a_console_that_says_goodbye_leaves_the_robot_to_whoever_comes() -> None:
    async with bridge_with(60.0) as bridge:
        async with RobotLink(*bridge.address, "operator", name="first"):
            pass
        async with RobotLink(*bridge.address, "operator", name="second") as link:
            assert link.connected


@pytest.mark.parametrize("name", ["first", ""])
async def test_when_the_time_is_over_or_there_was_no_name_another_console_gets_the_robot(name: str) -> None:
    async with bridge_with(0.3 if name else 60.0) as bridge:
        await lose_a_link(bridge, name)
        async with asyncio.timeout(20):
            while True:
                try:
                    async with RobotLink(*bridge.address, "operator", name="second") as link:
                        assert link.connected
                        return
                except (LinkRefused, LinkLost):
                    await asyncio.sleep(0.05)
