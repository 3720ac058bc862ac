"""The planar robot's cameras."""

import asyncio
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

from robot_bridge.metronome import Metronome
from robot_bridge.protocol.description import Camera
from robot_bridge.protocol.messages import Media
from robot_bridge.robots.base import MediaSource, Stamp
from robot_bridge.robots.planar.description import FRONT, OVERVIEW
from robot_bridge.robots.planar.drawing import FrontDrawing, OverviewDrawing

if TYPE_CHECKING:
    from robot_bridge.robots.planar.robot import PlanarState

__all__ = ["FrontCamera", "OverviewCamera"]


class Drawing(Protocol):
    def draw(self, state: "PlanarState", event: int) -> bytes:
        """A yuv420p picture of the state, with the event in its strip."""


class PlanarCamera(MediaSource):
    """Draws at a fixed rate. A drawing takes well under a millisecond, less than handing it to a thread would."""

    def __init__(self, camera: Camera, drawing: Drawing, state: "Callable[[], PlanarState]") -> None:
        self._camera = camera
        self._drawing = drawing
        self._state = state

    async def run(self, stamp: Callable[[], Stamp], emit: Callable[[Media], None]) -> None:
        metronome = Metronome(1 / self._camera.frame_rate, time.monotonic())
        while True:
            await asyncio.sleep(metronome.wait(time.monotonic()))
            now = stamp()
            emit(
                Media(
                    stream=self._camera.name,
                    codec="yuv420p",
                    stamp=now.event,
                    time=now.time,
                    payload=self._drawing.draw(self._state(), now.event),
                    width=self._camera.width,
                    height=self._camera.height,
                )
            )


class OverviewCamera(PlanarCamera):
    """Looks down on the room."""

    def __init__(self, state: "Callable[[], PlanarState]") -> None:
        super().__init__(OVERVIEW, OverviewDrawing(OVERVIEW.width, OVERVIEW.height), state)


class FrontCamera(PlanarCamera):
    """Looks ahead from the robot."""

    def __init__(self, state: "Callable[[], PlanarState]") -> None:
        super().__init__(FRONT, FrontDrawing(FRONT.width, FRONT.height), state)
