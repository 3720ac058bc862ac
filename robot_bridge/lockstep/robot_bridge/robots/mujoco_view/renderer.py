"""Draws and converts all pictures in one thread, since an OpenGL context belongs to a thread."""

import asyncio
import concurrent.futures
from collections.abc import Awaitable, Callable
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from lockstep.protocol.description import Camera
from lockstep.robot_bridge.robots.mujoco_view.canvas import DEFAULT_LOOK, Canvas, Look
from lockstep.robot_bridge.robots.mujoco_view.graphics import graphics_unavailable
from lockstep.robot_bridge.robots.mujoco_view.sheet import Sheet
from lockstep.robot_bridge.thread_name import name_thread

__all__ = ["Renderer"]


class Renderer:
    """Draws one picture at a time. It releases the interpreter while it draws, so that the loop runs on."""

    def __init__(self, model: Any, width: int, height: int, look: Look = DEFAULT_LOOK) -> None:
        """Start the thread; returns when the context is there. `width` and `height`: of the largest picture.

        Raises:
            RobotUnavailable: OpenGL cannot be used here.
        """
        self._sheets: dict[tuple[int, int], Sheet] = {}  # by size, used again for each picture
        self._thread = concurrent.futures.ThreadPoolExecutor(
            max_workers=1, thread_name_prefix="render", initializer=name_thread, initargs=("render",)
        )
        try:
            self._canvas: Canvas | None = self._thread.submit(Canvas, model, width, height, look).result()
        except (ImportError, RuntimeError, AttributeError, OSError, mujoco.FatalError) as error:
            self._thread.shutdown()
            raise graphics_unavailable(error) from error

    async def picture(self, camera: Camera, positions: npt.NDArray[np.float64]) -> bytes:
        """Return `camera`'s view of the state as yuv420p."""
        return await asyncio.get_running_loop().run_in_executor(self._thread, self._draw, camera, positions)

    def drawing(self, camera: Camera) -> Callable[[npt.NDArray[np.float64], int], Awaitable[bytes]]:
        """Return a function that draws a state for a source of pictures; it does not show the event."""
        return lambda positions, event: self.picture(camera, positions)

    def close(self) -> None:
        """End the thread after the picture that it draws. May be called again."""
        if self._canvas is not None:
            self._thread.submit(self._canvas.close)
            self._canvas = None
            self._thread.shutdown()

    def _draw(self, camera: Camera, positions: npt.NDArray[np.float64]) -> bytes:
        if self._canvas is None:
            raise RuntimeError("the renderer is closed")
        sheet = self._sheets.get((camera.width, camera.height))
        if sheet is None:
            sheet = self._sheets[camera.width, camera.height] = Sheet(camera.width, camera.height)
        self._canvas.draw(camera.name, positions, sheet.pixels)
        return sheet.yuv420p()
