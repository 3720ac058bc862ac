"""Sends the map of the robot to the media links, and its navigation to the operator link."""

import asyncio
import logging
from collections.abc import Callable

from lockstep.protocol.description import RobotDescription
from lockstep.protocol.maps import OccupancyMap
from lockstep.robot_bridge.control.event_core import EventCore
from lockstep.robot_bridge.link.sending.link_publisher import LinkPublisher
from lockstep.robot_bridge.maps.navigation_issuer import NavigationIssuer
from lockstep.robot_bridge.robots.base import Robot
from lockstep.robot_bridge.robots.navigation import GridMap

__all__ = ["MapSender"]

INTERVAL = 0.1  # s between two looks

_logger = logging.getLogger(__name__)


class MapSender:
    """A map travels on the links for media: a large one must not stand in front of a feedback."""

    def __init__(
        self,
        robot: Robot,
        description: RobotDescription,
        core: EventCore,
        publisher: LinkPublisher,
        now: Callable[[], float],
    ) -> None:
        self._robot = robot
        self._has_map = description.map is not None
        self._core = core
        self._publisher = publisher
        self._now = now
        self._issuer = NavigationIssuer()
        self._refused: GridMap | None = None  # could not be packed, and that was logged

    async def run(self) -> None:
        """Run until cancelled; it ends at once for a robot without a map.

        Raises:
            BaseException: the adapter raised.
        """
        while self._has_map:
            await asyncio.sleep(INTERVAL)
            await self._look_at_map()
            message = self._issuer.look(self._robot.navigation(), self._now(), self._core.current)
            if message is not None:
                self._publisher.publish_to_operator(message)

    async def _look_at_map(self) -> None:
        grid = self._robot.grid_map()
        if grid is None or grid is self._refused or not self._issuer.map_due(grid, self._now()):
            return
        try:
            packed = await asyncio.to_thread(_packed, grid)
        except ValueError as error:
            self._refused = grid
            _logger.error("the robot's map cannot be sent: %s", error)
            return
        message = self._issuer.packed(grid, packed, self._now())
        if message is not None:
            self._publisher.publish_map(message)


def _packed(grid: GridMap) -> OccupancyMap:
    """Packing needs numpy, which a robot's own bridge may not have."""
    from lockstep.robot_bridge.maps.map_packing import pack_map

    return pack_map(grid)
