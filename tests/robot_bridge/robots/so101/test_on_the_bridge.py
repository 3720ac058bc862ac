"""The arm behind a real bridge, over TCP."""

import asyncio

import numpy as np

from lockstep.bench.pick_place import PickAndPlace
from lockstep.protocol.messages import Feedback, Media, Refusal
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.link.link_client import RobotLink
from lockstep.robot_bridge.robots.event_strip import read_event_strip
from lockstep.robot_bridge.robots.so101.robot import So101
from lockstep.robot_bridge.settings import BridgeSettings
from tests.robot_bridge.bridge_helpers import operator

MOTIONS = 9
BRIGHT = 40  # of 255


async def receive(bridge: Bridge, pictures: dict[str, Media]) -> None:
    async with RobotLink(*bridge.address, "media") as link:
        async for message in link:
            if isinstance(message, Media):
                pictures[message.stream] = message


async def test_a_script_puts_a_block_into_the_bowl_over_the_robot_link(robot: So101) -> None:
    async with Bridge(robot, BridgeSettings(port=0)) as bridge, asyncio.timeout(120), operator(bridge) as driver:
        task = PickAndPlace(robot.describe(), "red")
        while not task.done and not task.failed:
            await driver.drive(task.values(driver.feedback))
        assert task.done, task.failed
        while robot.simulation.blocks_in_bowl() != 1:  # it may still fall
            await driver.drive([None] * len(robot.describe().axes))


async def test_a_goal_beyond_reach_is_refused_and_a_pose_with_joints_conflicts(robot: So101) -> None:
    names = [axis.name for axis in robot.describe().axes]

    def values(**goals: float) -> list[float | None]:
        return [goals.get(name.replace(".", "_")) for name in names]

    async with Bridge(robot, BridgeSettings(port=0)) as bridge, asyncio.timeout(30), operator(bridge) as driver:
        here = dict(zip(names, driver.feedback.axes, strict=True))
        refused = await driver.refused(driver.command(values(tool_z=here["tool.z"] + 0.3)))
        assert refused.reason == "jump"
        refused = await driver.refused(driver.command(values(tool_z=here["tool.z"], shoulder_pan=here["shoulder_pan"])))
        assert refused.reason == "conflict"
        assert isinstance(refused, Refusal)
        feedback = await driver.drive(values(gripper=here["gripper"] + 0.1))
        assert isinstance(feedback, Feedback)


async def test_both_cameras_show_the_table_and_the_event(robot: So101) -> None:
    pictures: dict[str, Media] = {}
    settings = BridgeSettings(port=0, event_strip=True)
    async with Bridge(robot, settings) as bridge, asyncio.timeout(30), operator(bridge) as driver:
        receiving = asyncio.create_task(receive(bridge, pictures))
        while len(pictures) < 2 or min(picture.stamp for picture in pictures.values()) < 3:
            await driver.drive([None] * len(robot.describe().axes))
        receiving.cancel()
        await asyncio.wait([receiving])
    for picture in pictures.values():
        luma = np.frombuffer(picture.payload, np.uint8, picture.width * picture.height)
        luma = luma.reshape(picture.height, picture.width)
        assert read_event_strip(luma) == picture.stamp
        assert luma[picture.height // 4 :].mean() > BRIGHT
        assert luma[picture.height // 4 :].std() > 10  # not one colour
