"""Reads the pictures of one source: H.264 and JPEG are passed on unchanged where possible, all else is decoded."""

import time
from collections.abc import Callable, Iterator
from typing import TypeAlias

import av
from av.bitstream import BitStreamFilterContext
from av.container import InputContainer
from av.packet import Packet
from av.video.frame import VideoFrame
from av.video.stream import VideoStream

from lockstep.server.media.codecs.h264 import START_CODE, H264Access, inspect
from lockstep.server.media.pipeline.frame_rate_limiter import FrameRateLimiter
from lockstep.server.media.sources.capture_timeline import SETTLE, CaptureTimeline
from lockstep.server.media.sources.errors import NoSuchMedium
from lockstep.server.media.sources.opening import Pace, kernel_time, opened, settled_lag
from lockstep.server.media.sources.source_url import SourceSpec
from lockstep.server.media.sources.source_wire import Captured

__all__ = ["read_pictures"]

NO_KEYFRAME = 300  # pictures without a keyframe; then they are decoded here
REMEMBERED = 64  # capture times of pictures that a decoder holds back

Emit = Callable[[Captured], None]
VideoPacket: TypeAlias = "Packet[VideoStream]"


def read_pictures(spec: SourceSpec, working: Callable[[str], None], captured: Emit) -> None:
    """Read one connection until it ends; a file begins again. Raises SourceError, FFmpegError, OSError."""
    decoded = False  # a stream with B-frames, or without keyframes, is decoded from then on
    while True:
        with opened(spec) as container:
            if not container.streams.video:
                raise NoSuchMedium("the source has no pictures")
            connection = _Connection(spec, container, decoded, captured)
            working(connection.detail)
            again = connection.read()
        if again:
            decoded = True
        elif spec.live:
            return


class _Connection:
    def __init__(self, spec: SourceSpec, container: InputContainer, decoded: bool, captured: Emit) -> None:
        self._spec = spec
        self._container = container
        self._captured = captured
        self._stream: VideoStream = container.streams.video[0]
        self._stream.thread_type = "NONE"  # threads of the decoder hold pictures back
        self._context = self._stream.codec_context
        self._timeline = CaptureTimeline(spec.latency, settle=SETTLE if spec.live else 0.0)
        self._pace = Pace()
        self._thin = FrameRateLimiter(spec.rate if spec.scheme != "v4l2" else None)
        self._times: dict[int, float] = {}  # capture times of the decoder's pictures, by their time in the stream
        self._sets = b""  # newest parameter sets
        self._begun = False  # a keyframe went on
        self._waited = 0  # pictures before the first keyframe
        changed = spec.size is not None and spec.scheme != "v4l2"
        codec = self._context.name
        self._as_is = not decoded and not changed
        self._h264 = codec == "h264" and spec.passing and self._as_is and (spec.rate is None or spec.scheme == "v4l2")
        self._jpeg = codec == "mjpeg" and self._as_is
        if self._h264 and self._context.has_b_frames:
            self._h264 = False
        self._filter = None
        if self._h264:
            extradata = self._context.extradata or b""
            if extradata[:1] == b"\x01":  # lengths instead of start codes (ISO/IEC 14496-15)
                self._filter = BitStreamFilterContext("h264_mp4toannexb", self._stream)
            else:
                self._sets = inspect(extradata).parameter_sets

    @property
    def detail(self) -> str:
        how = "" if self._h264 or self._jpeg else ", decoded"
        return f"{self._context.name} {self._context.width}x{self._context.height}{how}"

    def read(self) -> bool:
        """Read until the connection ends; True if it is to be opened again and decoded."""
        for packet in self._container.demux(self._stream):
            if packet.size == 0:
                continue  # the end, for decoders
            at = self._capture_time(packet)
            settled_lag(self._timeline.lag)
            if self._h264:
                if self._pass_on(packet, at):
                    return True
            elif self._jpeg:
                self._pass_jpeg(packet, at)
            else:
                self._decode(packet, at)
        return False

    def _capture_time(self, packet: VideoPacket) -> float | None:
        """Return the capture time on the monotonic clock; None while it is not known."""
        own = None if packet.pts is None else float(packet.pts * packet.time_base)
        if not self._spec.live:
            order = packet.dts if packet.dts is not None else packet.pts
            wait = 1 / 25 if order is None else float(order * packet.time_base)
            return self._pace.wait(wait) - self._spec.latency
        now = time.monotonic()
        if self._spec.scheme == "v4l2" and (kernel := kernel_time(own, now)) is not None:
            return kernel - self._spec.latency
        return self._timeline.place(own, 0.0, now)

    def _pass_on(self, packet: VideoPacket, at: float | None) -> bool:
        """Pass H.264 on; True if that is not possible: pictures are reordered, or no keyframe comes."""
        for data in self._annex_b(packet):
            access = inspect(data)
            if access.reordered:
                return True
            if access.parameter_sets:
                self._sets = access.parameter_sets
            if not self._begun and not self._begins(access):
                self._waited += 1
                if self._waited > NO_KEYFRAME:
                    return True
                continue
            if at is None:
                self._begun = False  # the stamp would be a guess
                continue
            if access.keyframe and not access.parameter_sets:
                data = self._sets + data
            size = self._context.width, self._context.height
            self._captured(Captured("h264", at, data, *size, keyframe=access.keyframe))
        return False

    def _begins(self, access: H264Access) -> bool:
        self._begun = access.keyframe and bool(self._sets)
        return self._begun

    def _annex_b(self, packet: VideoPacket) -> Iterator[bytes]:
        if self._filter is None:
            data = bytes(packet)
            yield data if data[:3] == START_CODE[1:] or data[:4] == START_CODE else START_CODE + data
            return
        for each in self._filter.filter(packet):
            yield bytes(each)

    def _pass_jpeg(self, packet: VideoPacket, at: float | None) -> None:
        if at is not None and self._thin.admit(at):
            self._captured(Captured("mjpeg", at, bytes(packet), self._context.width, self._context.height))

    def _decode(self, packet: VideoPacket, at: float | None) -> None:
        if at is not None and packet.pts is not None:
            self._times[packet.pts] = at
            if len(self._times) > REMEMBERED:
                del self._times[next(iter(self._times))]
        try:
            frames = packet.decode()
        except av.error.InvalidDataError:
            return  # the first after a loss; the next keyframe helps
        for frame in frames:
            # A picture that the decoder reorders was captured when its own packet came; a file's is captured now.
            taken = at if frame.pts is None or not self._spec.live else self._times.pop(frame.pts, None)
            if taken is not None and self._thin.admit(taken):
                self._emit(frame, taken)

    def _emit(self, frame: VideoFrame, at: float) -> None:
        width, height = self._spec.size or (frame.width, frame.height)
        width, height = max(16, width & ~1), max(16, height & ~1)
        whole = frame.reformat(width, height, format="yuv420p", dst_color_range="MPEG", interpolation="AREA")
        payload = whole.to_ndarray(format="yuv420p").tobytes()
        self._captured(Captured("yuv420p", at, payload, width, height))
