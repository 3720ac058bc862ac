"""The robot in C and our own bridge, to be asked the same questions."""

import json
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lockstep.protocol.description import RobotDescription
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.robots.planar import create
from lockstep.robot_bridge.settings import BridgeSettings
from tests.robot_bridge.bridge_helpers import Operator
from tests.support.c_robot import running_c_robot

__all__ = ["Robot", "description_of", "in_c", "in_python", "moving"]


@dataclass
class Robot:
    """A robot at an address, its own record, and what ends it."""

    address: tuple[str, int]
    event_log: Path
    close: Callable[[], Any]
    has_actions: bool

    async def records(self, *kinds: str) -> list[dict[str, Any]]:
        """What it has written down; call at the end, it is closed first."""
        await self.close()
        lines = [json.loads(line) for line in self.event_log.read_text().splitlines()]
        return [line for line in lines if line["kind"] in kinds]


@asynccontextmanager
async def in_c(directory: Path) -> AsyncIterator[Robot]:
    async with running_c_robot(directory) as robot:
        yield Robot(robot.address, robot.event_log, robot.end, has_actions=False)


@asynccontextmanager
async def in_python(directory: Path) -> AsyncIterator[Robot]:
    log = directory / "bridge.jsonl"
    async with Bridge(create(), BridgeSettings(port=0, event_log=log)) as bridge:
        yield Robot(bridge.address, log, bridge.close, has_actions=True)


def moving(driver: Operator) -> list[float]:
    """Half speed forward, whatever the robot's axes are."""
    axes = description_of(driver).axes
    return [axes[0].maximum / 2] + [axis.rest for axis in axes[1:]]


def description_of(driver: Operator) -> RobotDescription:
    description = driver.link.hello.description
    assert description is not None
    return description
