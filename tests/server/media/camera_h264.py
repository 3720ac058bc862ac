"""H.264 as a camera gives it, for tests."""

from fractions import Fraction
from typing import Any

import av
import numpy as np

from lockstep.protocol.messages import Media
from tests.server.media.viewer import HEIGHT, WIDTH, picture

__all__ = ["access_units", "camera_pictures"]


def access_units(count: int, *, profile: str = "baseline", gop: int = 5, b_frames: int = 0) -> list[bytes]:
    """So many pictures in Annex B form, a keyframe every `gop`; each is brighter than the one before."""
    context = av.CodecContext.create("libx264", "w")
    context.width, context.height, context.pix_fmt = WIDTH, HEIGHT, "yuv420p"
    context.framerate, context.time_base = Fraction(30), Fraction(1, 30)
    context.gop_size, context.max_b_frames = gop, b_frames
    context.options = {"preset": "veryfast", "profile": profile, "x264-params": f"scenecut=0:bframes={b_frames}"}
    units = []
    for number in range(count):
        luma = np.full((HEIGHT * 3 // 2, WIDTH), 128, np.uint8)
        luma[:HEIGHT] = 20 + 4 * (number % 50)
        luma[: HEIGHT // 2, (7 * number) % WIDTH] = 235
        frame = av.VideoFrame.from_ndarray(luma, format="yuv420p")
        frame.pts = number
        units += [bytes(packet) for packet in context.encode(frame)]
    return units + [bytes(packet) for packet in context.encode(None)]


def camera_pictures(count: int, first: int = 1, gop: int = 5, **encoding: Any) -> list[Media]:
    """The same as media; picture i has stamp i."""
    units = access_units(count, gop=gop, **encoding)
    return [
        picture(first + i, (first + i) / 30, codec="h264", payload=unit, keyframe=i % gop == 0)
        for i, unit in enumerate(units)
    ]
