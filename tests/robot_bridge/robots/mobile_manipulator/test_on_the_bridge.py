"""The robot behind a real bridge, over TCP."""

import asyncio
from pathlib import Path

import pytest

from lockstep.protocol.messages import Media
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.link.link_client import RobotLink
from lockstep.robot_bridge.robots.mobile_manipulator.robot import MobileManipulator
from lockstep.robot_bridge.settings import BridgeSettings
from tests.robot_bridge.bridge_helpers import log_lines, operator

EVENTS = 40


async def receive(bridge: Bridge, media: list[Media]) -> None:
    async with RobotLink(*bridge.address, "media") as link:
        async for message in link:
            if isinstance(message, Media):
                media.append(message)


async def test_while_driven_every_medium_carries_the_event_that_held_at_its_capture(
    robot: MobileManipulator, tmp_path: Path
) -> None:
    media: list[Media] = []
    log = tmp_path / "events.jsonl"
    values = [0.2, 0.0, 0.3, 0.0, 0.0, 0.05, 0.0, 0.0, 0.0]
    async with Bridge(robot, BridgeSettings(port=0, event_log=log)) as bridge, asyncio.timeout(30):
        receiving = asyncio.create_task(receive(bridge, media))
        async with operator(bridge) as driver:
            while len({medium.stream for medium in media}) < 3 or driver.feedback.event < EVENTS:
                feedback = await driver.drive(values)
        receiving.cancel()
        await asyncio.wait([receiving])
    assert feedback.joints[0] > 0.01
    assert feedback.axes[:3] == pytest.approx(values[:3], abs=0.15)
    issued = [(line["time"], line["event"]) for line in log_lines(log, "feedback")]
    assert len({event for _, event in issued}) >= EVENTS
    assert {medium.stream for medium in media} == {"overview", "wrist", "microphone"}
    for medium in media:
        held = max(event for time, event in issued if time <= medium.time)  # type: ignore[type-var, operator]
        assert medium.stamp == held
