"""A camera in the simulation."""

import asyncio
import time
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from robot_bridge.metronome import Metronome
from robot_bridge.protocol.description import Camera
from robot_bridge.protocol.messages import Media
from robot_bridge.robots.base import MediaSource, Stamp
from robot_bridge.robots.mujoco_view.renderer import Renderer

__all__ = ["CameraSource"]


class CameraSource(MediaSource):
    """Stamps and copies the state at one instant on the loop, and has it drawn in the render thread.

    At most one picture is being drawn: when drawing falls behind, the beats missed meanwhile are skipped.
    """

    def __init__(self, camera: Camera, renderer: Renderer, snapshot: Callable[[], npt.NDArray[np.float64]]) -> None:
        self._camera = camera
        self._renderer = renderer
        self._snapshot = snapshot

    async def run(self, stamp: Callable[[], Stamp], emit: Callable[[Media], None]) -> None:
        metronome = Metronome(1.0 / self._camera.frame_rate, time.monotonic())
        while True:
            await asyncio.sleep(metronome.wait(time.monotonic()))
            at, state = stamp(), self._snapshot()
            payload = await self._renderer.picture(self._camera, state)
            emit(
                Media(
                    stream=self._camera.name,
                    codec="yuv420p",
                    stamp=at.event,
                    time=at.time,
                    payload=payload,
                    width=self._camera.width,
                    height=self._camera.height,
                )
            )
