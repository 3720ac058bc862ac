"""H.264 and VP8 encoders for live pictures: no look-ahead, no B-frames, keyframes only when asked for."""

from abc import ABC, abstractmethod
from fractions import Fraction
from typing import NamedTuple

import av
from av.error import FFmpegError
from av.video.codeccontext import VideoCodecContext
from av.video.frame import PictureType

from lockstep.server.media.errors import EncodeError, UnsupportedCodecError
from lockstep.server.media.pipeline.media_clock import VIDEO_RATE

__all__ = ["VIDEO_CODECS", "EncodedPicture", "H264Encoder", "PictureEncoder", "Vp8Encoder", "create_picture_encoder"]

VIDEO_CODECS = ("H264", "VP8")
NEVER = 1_000_000  # frames between keyframes that nobody asked for
COARSE_BPS = 500_000  # below it the bitrate takes precedence over the picture's quality


class EncodedPicture(NamedTuple):
    data: bytes  # Annex B byte stream, or one VP8 frame
    keyframe: bool


class PictureEncoder(ABC):
    """Encodes the pictures of one stream. Used from one thread; follows changes of the picture's size.

    The libraries fix the bitrate when they open, and opening again costs a keyframe. So each subclass has a way to
    `steer` a running encoder, within the range that `steers` accepts.
    """

    def __init__(self, bitrate_bps: int, frame_rate: float) -> None:
        self.bitrate_bps = bitrate_bps
        self.frame_rate = frame_rate
        self._context: VideoCodecContext | None = None
        self._opened_bps = bitrate_bps  # of the running encoder when it was opened
        self._opened_rate = frame_rate
        self._pts = 0.0  # in 90 kHz; the encoder's time
        self._last_time: int | None = None

    def aim(self, bitrate_bps: int, frame_rate: float) -> None:
        """Set the bitrate and the frame rate from the next picture on."""
        self.bitrate_bps, self.frame_rate = bitrate_bps, frame_rate

    def encode(self, frame: av.VideoFrame, media_time: int, keyframe: bool) -> EncodedPicture:
        """Encode one picture. `media_time` is in 90 kHz and must increase.

        Raises:
            EncodeError: the library refused; the next picture starts afresh with a keyframe.
        """
        try:
            context = self._fit(frame)
            frame.pts, frame.time_base = self._steered(context, media_time), Fraction(1, VIDEO_RATE)
            frame.pict_type = PictureType.I if keyframe else PictureType.NONE
            packets = context.encode(frame)
        except (FFmpegError, ValueError) as error:
            self._context = None
            raise EncodeError(str(error)) from error
        if not packets:
            raise EncodeError("the encoder held the picture back")
        return EncodedPicture(b"".join(map(bytes, packets)), packets[0].is_keyframe)

    def _fit(self, frame: av.VideoFrame) -> VideoCodecContext:
        """Return the context for pictures of this size and bitrate; a new one begins with a keyframe."""
        context = self._context
        if (
            context is None
            or (context.width, context.height) != (frame.width, frame.height)
            or not self.steers(self.bitrate_bps / self._opened_bps, self.frame_rate / self._opened_rate)
        ):
            self._opened_bps, self._opened_rate = self.bitrate_bps, self.frame_rate
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

    def _steered(self, context: VideoCodecContext, media_time: int) -> int:
        """Steer the encoder for the picture at `media_time` and return the picture's time for it."""
        ratio = self.bitrate_bps / self._opened_bps
        passed = 0 if self._last_time is None else media_time - self._last_time
        self._last_time = media_time
        self._pts = max(self._pts + 1, self._pts + passed * self.steer(context, ratio))
        return round(self._pts)

    def _buffer_bits(self) -> int:
        """Return the bits that a keyframe may take at once: half a second of an ample bitrate, less of a scarce one."""
        return int(self.bitrate_bps * (0.3 if self.bitrate_bps < COARSE_BPS else 0.5))

    @abstractmethod
    def steers(self, bitrate: float, frame_rate: float) -> bool:
        """True if a running encoder can be steered to so many times the bitrate and frame rate it was opened with."""

    @abstractmethod
    def steer(self, context: VideoCodecContext, ratio: float) -> float:
        """Steer the encoder to `ratio`; return the speed at which time is to pass for it."""

    @abstractmethod
    def _open(self) -> VideoCodecContext:
        """Create a context with the codec's own options."""


class H264Encoder(PictureEncoder):
    """Constrained baseline; parameter sets in front of every keyframe.

    x264 takes a new bitrate while it runs, but not above the largest one it was opened with. It counts pictures, not
    time, so that another frame rate needs another encoder.
    """

    def steers(self, bitrate: float, frame_rate: float) -> bool:
        return 0.35 <= bitrate <= 1.0 and frame_rate == 1.0

    def steer(self, context: VideoCodecContext, ratio: float) -> float:
        if context.bit_rate != self.bitrate_bps:
            context.bit_rate = self.bitrate_bps
        return 1.0

    def _open(self) -> VideoCodecContext:
        context = av.CodecContext.create("libx264", "w")
        context.options = {
            "preset": "ultrafast",
            "tune": "zerolatency",
            "profile": "baseline",
            "forced-idr": "1",
            "maxrate": str(self.bitrate_bps),
            "bufsize": str(self._buffer_bits()),
            # x264 would go on to 69, where nothing but grey is left of a keyframe.
            "x264-params": "scenecut=0:keyint=infinite:repeat-headers=1:qpmax=51",
        }
        return context


class Vp8Encoder(PictureEncoder):
    """libvpx spends a bitrate over the time that passes between pictures, so time is what steers it."""

    def steers(self, bitrate: float, frame_rate: float) -> bool:
        return 0.25 <= bitrate <= 2.0

    def steer(self, context: VideoCodecContext, ratio: float) -> float:
        return ratio

    def _open(self) -> VideoCodecContext:
        context = av.CodecContext.create("libvpx", "w")
        context.qmin, context.qmax = 2, (63 if self.bitrate_bps < COARSE_BPS else 56)
        context.options = {
            "deadline": "realtime",
            "cpu-used": "-8",  # negative: this speed, whatever the load
            "lag-in-frames": "0",
            "minrate": str(self.bitrate_bps),
            "maxrate": str(self.bitrate_bps),
            "bufsize": str(self._buffer_bits()),
            "static-thresh": "1",
            "undershoot-pct": "100",
            "overshoot-pct": "15",
        }
        return context


def create_picture_encoder(codec: str, bitrate_bps: int, frame_rate: float) -> PictureEncoder:
    """Create an encoder for one of VIDEO_CODECS."""
    if codec == "H264":
        return H264Encoder(bitrate_bps, frame_rate)
    if codec == "VP8":
        return Vp8Encoder(bitrate_bps, frame_rate)
    raise UnsupportedCodecError(codec)
