"""Encoded pictures for the client's tests."""

from fractions import Fraction
from typing import Any

import av
import numpy as np

ENCODERS = {"VP8": "libvpx", "H264": "libx264"}
OPTIONS = {
    "VP8": {"deadline": "realtime", "lag-in-frames": "0"},
    "H264": {"tune": "zerolatency", "bf": "0", "sc_threshold": "0"},
}


def encode(codec: str, count: int, every: int = 100) -> list[bytes]:
    """Grey pictures, each lighter than the last, with a keyframe `every` so many."""
    context: Any = av.CodecContext.create(ENCODERS[codec], "w")
    context.width, context.height, context.pix_fmt = 64, 48, "yuv420p"
    context.time_base, context.gop_size, context.options = Fraction(1, 30), every, OPTIONS[codec]
    if codec == "H264":
        context.profile = "Baseline"
    encoded: list[bytes] = []
    for number in range(count):
        frame = av.VideoFrame.from_ndarray(np.full((72, 64), 16 + 8 * number, np.uint8), format="yuv420p")
        frame.pts = number
        encoded += [bytes(packet) for packet in context.encode(frame)]
    return encoded
