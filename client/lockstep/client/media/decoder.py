"""Decoders that keep each picture and sound tied to its stamp. No I/O; `decode` belongs in a thread."""

from collections import OrderedDict
from typing import Any, NamedTuple

import av

from lockstep.client.media.frame_assembler import EncodedFrame

__all__ = ["Decoded", "Decoder", "is_h264_keyframe", "is_vp8_keyframe"]

# RTP name → FFmpeg decoder, sample rate of the RTP clock, channels of the decoder (sound only)
DECODERS = {
    "VP8": ("vp8", 90_000, 0),
    "H264": ("h264", 90_000, 0),
    "opus": ("libopus", 48_000, 2),
    "PCMU": ("pcm_mulaw", 8_000, 1),
}
NAL_IDR = 5
NAL_SPS = 7
VP8_START_CODE = b"\x9d\x01\x2a"
REMEMBERED = 32  # frames that a decoder may keep back


def is_h264_keyframe(data: bytes) -> bool:
    """True if the access unit (RFC 6184, as an Annex B byte stream) can be decoded without earlier ones."""
    found = set()
    position = data.find(b"\x00\x00\x01")
    while 0 <= position < len(data) - 3:
        found.add(data[position + 3] & 0x1F)
        position = data.find(b"\x00\x00\x01", position + 3)
    return NAL_IDR in found and NAL_SPS in found


def is_vp8_keyframe(data: bytes) -> bool:
    """True if `data` is a keyframe (RFC 6386 9.1), from its first byte on."""
    return len(data) >= 10 and data[0] & 1 == 0 and data[3:6] == VP8_START_CODE


class Decoded(NamedTuple):
    """One decoded frame with the stamp of the encoded one that it came from."""

    frame: av.VideoFrame | av.AudioFrame
    stamp: int | None
    timestamp: int  # RTP timestamp
    captured: float | None = None  # s since 1970 on the sender's clock


class Decoder:
    """Decodes one stream.

    Raises:
        KeyError: there is no decoder for this codec.
    """

    def __init__(self, codec: str) -> None:
        name, clock_rate, channels = DECODERS[codec]
        context: Any = av.CodecContext.create(name, "r")
        if channels:
            context.sample_rate = clock_rate
            context.format = "s16"
            context.layout = "stereo" if channels == 2 else "mono"
        self._context = context
        self._number = 0
        self._origin: OrderedDict[int, EncodedFrame] = OrderedDict()

    def decode(self, encoded: EncodedFrame) -> list[Decoded]:
        """Decode `encoded` and return the frames that come out.

        Raises:
            av.FFmpegError: the data is not a frame of this codec.
        """
        self._number += 1
        self._origin[self._number] = encoded
        if len(self._origin) > REMEMBERED:
            self._origin.popitem(last=False)
        packet = av.Packet(encoded.data)
        packet.pts = packet.dts = self._number  # so that a frame names the packet that it came from
        decoded = []
        for frame in self._context.decode(packet):
            source = self._origin.pop(frame.pts, None) if frame.pts is not None else None
            if source is None:
                decoded.append(Decoded(frame, None, 0))
            else:
                decoded.append(Decoded(frame, source.stamp, source.timestamp, source.captured))
        return decoded
