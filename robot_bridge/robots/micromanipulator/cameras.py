"""The microscope and the side view as sources of pictures."""

import asyncio
import time
from collections.abc import Awaitable, Callable
from typing import TYPE_CHECKING

from robot_bridge.metronome import Metronome
from robot_bridge.protocol.description import Camera
from robot_bridge.protocol.messages import Media
from robot_bridge.robots.base import MediaSource, Stamp

if TYPE_CHECKING:
    from robot_bridge.robots.micromanipulator.robot import MicromanipulatorState

__all__ = ["MicromanipulatorCamera"]


class MicromanipulatorCamera(MediaSource):
    """Takes stamp and state at one instant on the loop, and has them drawn in a thread.

    At most one picture is being drawn: when drawing falls behind, the beats missed meanwhile are skipped.
    """

    def __init__(
        self,
        camera: Camera,
        draw: "Callable[[MicromanipulatorState, int], Awaitable[bytes]]",
        state: "Callable[[], MicromanipulatorState]",
    ) -> None:
        self._camera = camera
        self._draw = draw
        self._state = state

    async def run(self, stamp: Callable[[], Stamp], emit: Callable[[Media], None]) -> None:
        metronome = Metronome(1 / self._camera.frame_rate, time.monotonic())
        while True:
            await asyncio.sleep(metronome.wait(time.monotonic()))
            now, state = stamp(), self._state()
            payload = await self._draw(state, now.event)
            emit(
                Media(
                    stream=self._camera.name,
                    codec="yuv420p",
                    stamp=now.event,
                    time=now.time,
                    payload=payload,
                    width=self._camera.width,
                    height=self._camera.height,
                )
            )
