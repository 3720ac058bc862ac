"""A robot's map and navigation over real TCP, for links that were there and links that come later."""

import asyncio

from lockstep.protocol.actions import Act, ActionUpdate
from lockstep.protocol.maps import Navigation, map_cells
from lockstep.protocol.messages import Feedback
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.link.link_client import RobotLink
from lockstep.robot_bridge.robots.planar.floor_map import make_map
from lockstep.robot_bridge.settings import BridgeSettings
from tests.robot_bridge.bridge_helpers import NEUTRAL, RecordingRobot, next_map, operator
from tests.waiting import PATIENCE


async def test_every_media_link_gets_the_newest_map_and_the_operator_its_id() -> None:
    robot = RecordingRobot(map=True)
    async with Bridge(robot, BridgeSettings(port=0)) as bridge:
        async with RobotLink(*bridge.address, "media", name="early") as early:
            first = await next_map(early)
            async with RobotLink(*bridge.address, "media", name="late") as late:
                assert await next_map(late) == first
            assert map_cells(first) == robot._map.cells
            robot._map = make_map(0.0)._replace(resolution=0.06)
            second = await next_map(early)
            assert (second.id != first.id, second.resolution) == (True, 0.06)
        async with operator(bridge) as driver, asyncio.timeout(PATIENCE):
            while (told := await driver.next(Navigation)).map != second.id:
                pass
            assert told.located


async def test_a_goal_that_runs_is_told_with_its_path_until_nothing_renews_it() -> None:
    robot = RecordingRobot(map=True)
    async with Bridge(robot, BridgeSettings(port=0)) as bridge, operator(bridge) as driver:
        async with asyncio.timeout(PATIENCE):
            await driver.drive(NEUTRAL)
            nonce = (await driver.next(Feedback)).nonce
            driver.link.send(Act(id="go", name="go_to", parameters={"x": 3.0, "y": 0.5}, nonce=nonce))
            while (await driver.next(ActionUpdate)).state != "cancelled":
                pass
            while (await driver.next(Navigation)).goal:
                pass
