"""Draws pictures in a thread: each takes some milliseconds, which the control tick does not have."""

import asyncio
import concurrent.futures
from typing import TYPE_CHECKING

from lockstep.robot_bridge.robots.micromanipulator.description import MICROSCOPE, SIDE
from lockstep.robot_bridge.robots.micromanipulator.microscope import Microscope
from lockstep.robot_bridge.robots.micromanipulator.side_view import SideView

if TYPE_CHECKING:
    from lockstep.robot_bridge.robots.micromanipulator.robot import MicromanipulatorState

__all__ = ["Draughtsman"]


class Draughtsman:
    """Draws both pictures one after the other, each in yuv420p."""

    def __init__(self) -> None:
        self._thread = concurrent.futures.ThreadPoolExecutor(max_workers=1, thread_name_prefix="draw")
        self._microscope = Microscope(MICROSCOPE.width, MICROSCOPE.height)
        self._side = SideView(SIDE.width, SIDE.height)

    async def microscope(self, state: "MicromanipulatorState", event: int) -> bytes:
        return await asyncio.get_running_loop().run_in_executor(self._thread, self._microscope.draw, state, event)

    async def side(self, state: "MicromanipulatorState", event: int) -> bytes:
        return await asyncio.get_running_loop().run_in_executor(self._thread, self._side.draw, state, event)

    def close(self) -> None:
        """End the thread after the picture that it draws. May be called again."""
        self._thread.shutdown()
