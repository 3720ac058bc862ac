"""From browser to topic and back: Chromium drives a real ROS 2 node, which says what reached it."""

from collections.abc import AsyncIterator
from pathlib import Path

import pytest
import pytest_asyncio
from playwright.async_api import Browser, expect

from lockstep.bench.browsers.console_page import open_console
from lockstep.bench.browsers.event_strip import drawn_event
from lockstep.bench.browsers.pad import LEFT_Y, RB
from tests.support.ros2 import EXAMPLES, RosRobot, have_ros, ros_python, running_ros_robot
from tests.support.stack import Stack, running_stack

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(not have_ros(), reason="there are no wheels of ROS 2 for this machine"),
]


@pytest_asyncio.fixture(loop_scope="session")
async def node(tmp_path: Path) -> AsyncIterator[RosRobot]:
    async with running_ros_robot(tmp_path) as robot:
        yield robot


@pytest_asyncio.fixture(loop_scope="session")
async def base(tmp_path: Path, node: RosRobot) -> AsyncIterator[Stack]:
    extra = ("--ros2", str(EXAMPLES / "base.yaml"), "--robot-python", ros_python())
    async with running_stack(tmp_path, extra=extra, settings=node.environment) as stack:
        yield stack


async def test_the_page_drives_the_node_and_shows_what_it_says(base: Stack, node: RosRobot, chromium: Browser) -> None:
    async with open_console(chromium, base.operator) as console:
        await console.until_live()
        await console.arm()
        await console.drive_forward()
        await console.until("s.axes['base.vx'] > 0.45", 30)  # by its odometry
        await expect(console.page.locator(".radar")).to_be_visible()  # by its laser scan
        read = await drawn_event(console.page, "front")  # the number that the camera drew into its picture
        assert read is not None
        assert read[1] in {note["number"] for note in node.notes("picture")}
        await console.pad.press(RB, False)
        await console.until("!s.driving && s.at_rest === true")  # so is a robot that still has a last 1 cm/s to go
        twists = [note["values"] for note in await node.ended_in_one_zero()]
        assert 0.45 < max(forward for forward, _ in twists) < 0.501, "the stick's full travel, or nearly"

        await console.pad.press(RB)
        await console.until("s.driving && s.at_rest === false")
        await node.tell("hush /odom")
        await console.until("s.axes['base.vx'] === null && s.faults.some((x) => x.startsWith('/odom: no message'))")
        await expect(console.page.get_by_text("/odom: no message for").first).to_be_visible()
        await console.pad.press(RB, False)
        await console.pad.tilt(LEFT_Y, 0)
        await node.tell("speak /odom")
        await console.until("s.axes['base.vx'] === 0 && s.faults.length === 0")
        await node.ended_in_one_zero(motions=2)
    executed = [record["event"] for record in await base.events("executed")]
    assert executed == sorted(set(executed))
