"""A buffer for drawn pictures, and their conversion into planes."""

import av
import numpy as np
from av.video.reformatter import VideoReformatter

__all__ = ["Sheet"]


class Sheet:
    """Pixels of one size, used for one picture after the other in one thread.

    Attributes:
        pixels: (height, width, RGBA), the lowest row first, as OpenGL has it
    """

    def __init__(self, width: int, height: int) -> None:
        self.pixels = np.zeros((height, width, 4), np.uint8)
        self._frame = av.VideoFrame.from_numpy_buffer(self.pixels, "rgba")  # without a copy
        self._reformatter = VideoReformatter()  # kept: it holds the prepared conversion

    def yuv420p(self) -> bytes:
        """Return planes Y, U, V without padding, the highest row first, BT.601 limited range."""
        converted = self._reformatter.reformat(self._frame, format="yuv420p", threads=1)
        planes = (
            np.frombuffer(memoryview(plane), np.uint8).reshape(-1, plane.line_size)[::-1, : plane.width]
            for plane in converted.planes
        )
        return b"".join(plane.tobytes() for plane in planes)
