"""The render thread: OpenGL contexts belong to a thread, so all pictures are drawn and converted in this one."""

import asyncio
import concurrent.futures
from typing import Any

import av
import mujoco
import numpy as np
import numpy.typing as npt
from av.video.reformatter import VideoReformatter

from robot_bridge.protocol.description import Camera
from robot_bridge.robots.mujoco_view.canvas import DEFAULT_LOOK, Canvas, Look
from robot_bridge.robots.mujoco_view.graphics import graphics_unavailable

__all__ = ["Converter", "Renderer"]


class Renderer:
    """Draws one picture at a time. It releases the interpreter while it draws, so that the loop runs on."""

    def __init__(self, model: Any, width: int, height: int, look: Look = DEFAULT_LOOK) -> None:
        """Returns when the context is there. `width` and `height` of the largest picture.

        Raises:
            RobotUnavailable: OpenGL cannot be used here.
        """
        self._converter = Converter()
        self._thread = concurrent.futures.ThreadPoolExecutor(max_workers=1, thread_name_prefix="render")
        try:
            self._canvas: Canvas | None = self._thread.submit(Canvas, model, width, height, look).result()
        except (ImportError, RuntimeError, AttributeError, OSError, mujoco.FatalError) as error:
            self._thread.shutdown()
            raise graphics_unavailable(error) from error

    async def picture(self, camera: Camera, positions: npt.NDArray[np.float64]) -> bytes:
        """`camera`'s view of the state as yuv420p."""
        return await asyncio.get_running_loop().run_in_executor(self._thread, self._draw, camera, positions)

    def close(self) -> None:
        """Waits for the picture being drawn. May be called again."""
        if self._canvas is not None:
            self._thread.submit(self._canvas.close)
            self._canvas = None
            self._thread.shutdown()

    def _draw(self, camera: Camera, positions: npt.NDArray[np.float64]) -> bytes:
        if self._canvas is None:
            raise RuntimeError("the renderer is closed")
        return self._converter.yuv420p(self._canvas.draw(camera.name, camera.width, camera.height, positions))


class Converter:
    """From RGB rows, the lowest first, to planes Y, U, V without padding, BT.601 limited range. For one thread."""

    def __init__(self) -> None:
        self._reformatter = VideoReformatter()  # kept: it holds the prepared conversion
        self._sources: dict[tuple[int, ...], av.VideoFrame] = {}  # by shape, kept: each picture overwrites the last

    def yuv420p(self, rgb: npt.NDArray[np.uint8]) -> bytes:
        height, width, _ = rgb.shape
        source = self._sources.setdefault(rgb.shape, av.VideoFrame(width, height, "rgb24"))
        rows = np.frombuffer(memoryview(source.planes[0]), np.uint8).reshape(height, -1)  # a row may be padded
        rows[:, : 3 * width] = rgb.reshape(height, -1)[::-1]  # OpenGL's first row is the lowest
        converted = self._reformatter.reformat(source, format="yuv420p", threads=1)
        if all(plane.line_size == plane.width for plane in converted.planes):
            return b"".join(converted.planes)
        return converted.to_ndarray().tobytes()
