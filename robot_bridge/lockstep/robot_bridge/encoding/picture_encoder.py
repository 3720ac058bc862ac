"""Encodes a camera's pictures to H.264 with PyAV. Used from one thread."""

from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import NoReturn

import av
from av.error import FFmpegError
from av.video.codeccontext import VideoCodecContext
from av.video.frame import PictureType
from av.video.plane import VideoPlane

from lockstep.protocol.messages import Media
from lockstep.robot_bridge.encoding.encoder_choice import SOFTWARE, log_fallback
from lockstep.robot_bridge.encoding.encoding_requests import EncodingGoal
from lockstep.robot_bridge.encoding.picture_encoding import EncodedPicture
from lockstep.robot_bridge.errors import EncodingFailed

__all__ = ["MOST_WRONG", "H264Encoder"]

CLOCK = 90_000  # Hz
NEVER = 1_000_000  # pictures between keyframes that nobody asked for
ASSUMED_RATE = 30.0  # Hz, of a camera whose rate nobody says
# x264 takes a lower bitrate while it runs, but none above the one at which it was opened, and only when that is its
# maximum too. So it is opened with room to spare.
HEADROOM = 1.3
LEAST = 0.35  # of that, down to which x264 follows while it runs
HARDWARE = (0.6, 1.0)  # of the bitrate at which another encoder was opened: beyond, it is opened again
KEYFRAME_SECONDS = 0.3  # of the bitrate that a keyframe may take at once
MAX_PIXELS = 4096 * 2304
MIN_SIDE = 16
CONSTRAINED_BASELINE = 66 | 1 << 9  # FFmpeg's number
MOST_WRONG = 3  # pictures in a row for which another encoder gives no packet of theirs; then SOFTWARE takes its place
PIXELS = {"h264_qsv": "nv12"}  # of encoders that do not take yuv420p


class H264Encoder:
    """Constrained baseline; parameter sets in front of every keyframe; no reordering, no delay.

    What `encode` returns is the picture that it was given: an encoder that returns another one is opened again. Where
    the named encoder cannot be used, the software encoder takes its place, and `fell_back` hears why.
    """

    def __init__(
        self,
        encoder: str = SOFTWARE,
        frame_rate: float = ASSUMED_RATE,
        *,
        keyframe_seconds: float = KEYFRAME_SECONDS,
        fell_back: Callable[[str], None] = log_fallback,
    ) -> None:
        """`encoder`: FFmpeg's name.

        Args:
            frame_rate: the camera's, in Hz
            keyframe_seconds: of the bitrate that a keyframe may take at once
            fell_back: called in the encoder's thread with the reason when the software encoder takes its place
        """
        self._name = encoder
        self._keyframe_seconds = keyframe_seconds
        self._fell_back = fell_back
        self._frame_rate = frame_rate
        self._context: VideoCodecContext | None = None
        self._opened = 0.0  # bit/s
        self._opened_rate = 0.0  # Hz
        self._pts = -1
        self._wrong = 0  # pictures in a row for which the encoder gave no packet of theirs
        self._jpeg: VideoCodecContext | None = None

    def encode(self, media: Media, goal: EncodingGoal, keyframe: bool) -> EncodedPicture:
        """Encode one picture, `yuv420p` or `mjpeg`.

        Raises:
            EncodingFailed: it is no picture; or the encoder refused it, or gave no packet or one of another picture:
                then the next picture begins afresh with a keyframe.
        """
        try:
            frame = self._frame(media)
            size = goal.size(frame.width, frame.height)
            context = self._fit(size, goal)
            if (*size, context.pix_fmt) != (frame.width, frame.height, frame.format.name):
                frame = frame.reformat(*size, format=context.pix_fmt, interpolation="AREA")
            self._pts = max(self._pts + 1, round(media.time * CLOCK))
            frame.pts, frame.time_base = self._pts, Fraction(1, CLOCK)
            frame.pict_type = PictureType.I if keyframe else PictureType.NONE
            packets = context.encode(frame)
        except (FFmpegError, ValueError) as error:
            self._context = None
            raise EncodingFailed(str(error)) from error
        if len(packets) != 1 or packets[0].pts != frame.pts or packets[0].time_base != frame.time_base:
            self._gave_wrong(packets)
        self._wrong = 0
        return EncodedPicture(bytes(packets[0]), packets[0].is_keyframe, *size)

    def _gave_wrong(self, packets: Sequence[object]) -> NoReturn:
        """Drop an encoder that gave no packet of its picture, with all that it still holds back: it is older.

        Raises:
            EncodingFailed: always.
        """
        self._context = None
        why = "it gave a packet of another picture" if packets else "it held the picture back"
        self._wrong += 1
        if self._wrong >= MOST_WRONG and self._name != SOFTWARE:
            self.fall_back(f"{self._name} cannot be used: {why}, {self._wrong} times in a row")
        raise EncodingFailed(f"no picture of the encoder: {why}")

    def fall_back(self, why: str) -> None:
        """Go on with the software encoder, from the next picture on."""
        self._name, self._wrong = SOFTWARE, 0
        self._fell_back(why)

    def _frame(self, media: Media) -> av.VideoFrame:
        if media.codec == "mjpeg":
            return self._from_jpeg(media)
        if media.codec != "yuv420p":
            raise EncodingFailed(f"{media.codec} pictures cannot be encoded")
        return _from_yuv420p(media)

    def _from_jpeg(self, media: Media) -> av.VideoFrame:
        if self._jpeg is None:
            self._jpeg = av.CodecContext.create("mjpeg", "r")
            self._jpeg.options = {"max_pixels": str(MAX_PIXELS)}
            self._jpeg.thread_count = 1
        frames = self._jpeg.decode(av.Packet(media.payload))
        if not frames:
            raise EncodingFailed("not a whole JPEG picture")
        return frames[-1].reformat(format="yuv420p", dst_color_range="MPEG")

    def _fit(self, size: tuple[int, int], goal: EncodingGoal) -> VideoCodecContext:
        """Return an encoder for this size and bitrate. A new one begins with a keyframe."""
        rate = min(goal.frame_rate or self._frame_rate, self._frame_rate)
        context = self._context
        if context is None or (context.width, context.height) != size or not self._follows(goal.bitrate, rate):
            context = self._open(size, goal.bitrate, rate)
        if self._name == SOFTWARE and context.bit_rate != goal.bitrate:
            context.bit_rate = goal.bitrate
        return context

    def _follows(self, bitrate: float, rate: float) -> bool:
        least, most = (LEAST, 1.0) if self._name == SOFTWARE else HARDWARE
        return least <= bitrate / self._opened <= most and rate == self._opened_rate

    def _open(self, size: tuple[int, int], bitrate: int, rate: float) -> VideoCodecContext:
        if self._name != SOFTWARE:
            try:
                context = self._open_as(
                    self._name, size, bitrate, rate, _hardware_options(self._name, bitrate, self._keyframe_seconds)
                )
                self._opened = bitrate / HARDWARE[1]
                return context
            except (FFmpegError, ValueError) as error:
                self.fall_back(f"{self._name} cannot be opened: {error}")
        self._opened = bitrate * HEADROOM
        return self._open_as(
            SOFTWARE, size, int(self._opened), rate, _software_options(bitrate, self._keyframe_seconds)
        )

    def _open_as(
        self, name: str, size: tuple[int, int], bitrate: int, rate: float, options: dict[str, str]
    ) -> VideoCodecContext:
        context = av.CodecContext.create(name, "w")
        if not isinstance(context, VideoCodecContext):
            raise ValueError(f"{name} is no encoder of pictures")
        context.width, context.height = size
        context.pix_fmt = PIXELS.get(name, "yuv420p")
        context.bit_rate = bitrate
        context.framerate = Fraction(rate).limit_denominator(1000)
        context.time_base = Fraction(1, CLOCK)
        context.gop_size = NEVER
        context.max_b_frames = 0
        context.thread_count = 1
        context.options = options
        context.open()
        self._opened_rate = rate
        self._context = context
        return context


def _software_options(bitrate: int, keyframe_seconds: float) -> dict[str, str]:
    return {
        "preset": "ultrafast",
        "tune": "zerolatency",
        "profile": "baseline",
        "forced-idr": "1",
        "maxrate": str(int(bitrate * HEADROOM)),
        "bufsize": str(int(bitrate * keyframe_seconds)),
        # x264 would go on to 69, where nothing but grey is left of a keyframe.
        "x264-params": "scenecut=0:keyint=infinite:repeat-headers=1:qpmax=51",
    }


def _hardware_options(name: str, bitrate: int, keyframe_seconds: float) -> dict[str, str]:
    """Return what an encoder needs to give each picture at once; one that does not know an option ignores it.

    h264_v4l2m2m has no option for that: it waits for its picture by itself.
    """
    options = {"maxrate": str(bitrate), "bufsize": str(int(bitrate * keyframe_seconds)), "profile": "baseline"}
    if name == "h264_nvenc":
        options |= {"delay": "0", "zerolatency": "1", "forced-idr": "1"}
    elif name == "h264_qsv":
        options |= {"async_depth": "1", "forced_idr": "1"}
    elif name == "h264_v4l2m2m":
        options["profile"] = str(CONSTRAINED_BASELINE)  # it knows no names of profiles
    return options


def _from_yuv420p(media: Media) -> av.VideoFrame:
    width, height = media.width, media.height
    half = (width + 1) // 2, (height + 1) // 2
    if width < MIN_SIDE or height < MIN_SIDE or width * height > MAX_PIXELS:
        raise EncodingFailed(f"a picture of {width}x{height} pixels cannot be encoded")
    if len(media.payload) != width * height + 2 * half[0] * half[1]:
        raise EncodingFailed(f"{len(media.payload)} bytes are not a yuv420p picture of {width}x{height}")
    # The encoder takes even sides only: a side with an odd number of pixels loses its last one.
    frame = av.VideoFrame(width - width % 2, height - height % 2, "yuv420p")
    data, at = memoryview(media.payload), 0
    for plane, (columns, rows) in zip(frame.planes, ((width, height), half, half), strict=True):
        _fill(plane, data[at : at + columns * rows], columns)
        at += columns * rows
    return frame


def _fill(plane: VideoPlane, data: memoryview, columns: int) -> None:
    """Copy rows of `columns` bytes into a plane, whose rows may be padded."""
    if plane.line_size == columns and len(data) == plane.buffer_size:
        plane.update(bytes(data))
        return
    padded = bytearray(plane.buffer_size)
    for row in range(plane.height):
        padded[row * plane.line_size : row * plane.line_size + plane.width] = data[
            row * columns : row * columns + plane.width
        ]
    plane.update(bytes(padded))
