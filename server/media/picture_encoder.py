"""H.264 and VP8 encoders for live pictures: no look-ahead, no B-frames, keyframes only when asked for."""

from abc import ABC, abstractmethod
from fractions import Fraction
from typing import NamedTuple

import av
from av.error import FFmpegError
from av.video.codeccontext import VideoCodecContext
from av.video.frame import PictureType

from server.media.errors import EncodeError, UnsupportedCodecError
from server.media.media_clock import VIDEO_RATE

__all__ = ["VIDEO_CODECS", "EncodedPicture", "H264Encoder", "PictureEncoder", "Vp8Encoder", "create_picture_encoder"]

VIDEO_CODECS = ("H264", "VP8")
NEVER = 1_000_000  # frames between keyframes that nobody asked for


class EncodedPicture(NamedTuple):
    data: bytes  # Annex B byte stream, or one VP8 frame
    keyframe: bool


class PictureEncoder(ABC):
    """Encodes the pictures of one stream. Used from one thread; follows changes of the picture's size."""

    def __init__(self, bitrate_bps: int, frame_rate: float) -> None:
        self.bitrate_bps = bitrate_bps
        self.frame_rate = frame_rate
        self._context: VideoCodecContext | None = None

    def encode(self, frame: av.VideoFrame, media_time: int, keyframe: bool) -> EncodedPicture:
        """One picture in, one out. `media_time` is in 90 kHz and must increase.

        Raises:
            EncodeError: the library refused; the next picture starts afresh with a keyframe.
        """
        try:
            context = self._fit(frame)
            frame.pts, frame.time_base = media_time, Fraction(1, VIDEO_RATE)
            frame.pict_type = PictureType.I if keyframe else PictureType.NONE
            packets = context.encode(frame)
        except (FFmpegError, ValueError) as error:
            self._context = None
            raise EncodeError(str(error)) from error
        if not packets:
            raise EncodeError("the encoder held the picture back")
        return EncodedPicture(b"".join(map(bytes, packets)), packets[0].is_keyframe)

    def _fit(self, frame: av.VideoFrame) -> VideoCodecContext:
        context = self._context
        if context is None or (context.width, context.height) != (frame.width, frame.height):
            context = self._open()
            context.width, context.height = frame.width, frame.height
            context.pix_fmt = "yuv420p"
            context.bit_rate = self.bitrate_bps
            context.framerate = Fraction(self.frame_rate).limit_denominator(1000)
            context.time_base = Fraction(1, VIDEO_RATE)
            context.gop_size = NEVER
            context.max_b_frames = 0
            context.thread_count = 1
            self._context = context
        return context

    @abstractmethod
    def _open(self) -> VideoCodecContext:
        """A context with the codec's own options."""


class H264Encoder(PictureEncoder):
    """Constrained baseline; parameter sets in front of every keyframe."""

    def _open(self) -> VideoCodecContext:
        context = av.CodecContext.create("libx264", "w")
        context.options = {
            "preset": "ultrafast",
            "tune": "zerolatency",
            "profile": "baseline",
            "forced-idr": "1",
            "maxrate": str(self.bitrate_bps),
            "bufsize": str(self.bitrate_bps // 2),  # bounds a keyframe to half a second of the bitrate
            "x264-params": "scenecut=0:keyint=infinite:repeat-headers=1",
        }
        return context


class Vp8Encoder(PictureEncoder):
    def _open(self) -> VideoCodecContext:
        context = av.CodecContext.create("libvpx", "w")
        context.qmin, context.qmax = 2, 56
        context.options = {
            "deadline": "realtime",
            "cpu-used": "-8",  # negative: this speed, whatever the load
            "lag-in-frames": "0",
            "minrate": str(self.bitrate_bps),
            "maxrate": str(self.bitrate_bps),
            "bufsize": str(self.bitrate_bps // 2),
            "static-thresh": "1",
            "undershoot-pct": "100",
            "overshoot-pct": "15",
        }
        return context


def create_picture_encoder(codec: str, bitrate_bps: int, frame_rate: float) -> PictureEncoder:
    """An encoder for one of VIDEO_CODECS."""
    if codec == "H264":
        return H264Encoder(bitrate_bps, frame_rate)
    if codec == "VP8":
        return Vp8Encoder(bitrate_bps, frame_rate)
    raise UnsupportedCodecError(codec)
