"""VP8 pictures as RTP payloads (RFC 7741)."""

from collections.abc import Iterator
from fractions import Fraction

import av

__all__ = ["packetise"]

SIZE = 1100  # bytes of a payload


def packetise(count: int, size: int = 64) -> Iterator[list[bytes]]:
    """The payloads of `count` pictures; the first is a keyframe."""
    encoder = av.CodecContext.create("libvpx", "w")
    encoder.width = encoder.height = size
    encoder.pix_fmt = "yuv420p"
    encoder.time_base = Fraction(1, 30)
    encoder.options = {"deadline": "realtime", "lag-in-frames": "0"}
    for number in range(count):
        frame = av.VideoFrame(size, size, "yuv420p")
        for plane in frame.planes:
            plane.update(bytes([number * 16 % 256]) * plane.buffer_size)
        frame.pts = number
        for packet in encoder.encode(frame):
            data = bytes(packet)
            parts = [data[start : start + SIZE] for start in range(0, len(data), SIZE)]
            # RFC 7741 4.2: S, the start of a partition, in the first byte of the first payload
            yield [bytes((0x10 if place == 0 else 0,)) + part for place, part in enumerate(parts)]
