"""One camera: the newest picture is encoded once per codec that somebody needs."""

import time
from functools import partial
from typing import NamedTuple

import av

from robot_bridge.protocol.description import Camera
from robot_bridge.protocol.messages import Media
from server.media.errors import MediaError, PayloadError, UnsupportedCodecError
from server.media.fanout import FanOut
from server.media.frame import EncodedFrame
from server.media.frame_pace import FramePace
from server.media.media_clock import PictureClock
from server.media.metrics import MediaMetrics
from server.media.output import Output
from server.media.packetise import packetise_h264, packetise_vp8
from server.media.picture import PictureDecoder
from server.media.picture_encoder import VIDEO_CODECS, PictureEncoder, create_picture_encoder
from server.media.settings import MediaSettings
from server.media.stream import Encoded, Stream

__all__ = ["VideoStream"]


class Order(NamedTuple):
    """What one output needs of a picture."""

    output: Output
    keyframe: bool
    variants: frozenset[bool]  # with and without trailer, to be packetised in the worker
    capture_time: float


class PictureJob(NamedTuple):
    media: Media
    media_time: int
    orders: list[Order]


class VideoStream(Stream[PictureJob]):
    """Takes yuv420p and mjpeg, encoded to H.264 and VP8; h264 is passed on to H.264 peers as it is."""

    kind = "video"
    codecs = VIDEO_CODECS

    def __init__(self, camera: Camera, settings: MediaSettings, fan_out: FanOut, metrics: MediaMetrics) -> None:
        super().__init__(camera.name, camera.label, settings, fan_out, metrics)
        self._frame_rate = camera.frame_rate
        self._clock = PictureClock()
        self._pace = FramePace(settings.video_frames_per_second)
        self._newest: tuple[Media, float, float] | None = None  # medium, now, capture time
        self._decoder = PictureDecoder()
        self._encoders: dict[str, PictureEncoder] = {}
        self._picture_id = 0

    def _enqueue(self, media: Media, now: float, capture_time: float) -> None:
        if media.codec == "h264":
            self._pass_on(media, capture_time)
            return
        if not self._pace.admit(media.time):
            self._drop("thinned")
            return
        if self._newest is not None:
            self._drop("encoder_busy")
        self._newest = media, now, capture_time
        self._wake.set()

    def _pass_on(self, media: Media, capture_time: float) -> None:
        """A picture that was encoded at the robot. Its encoder cannot be asked for keyframes."""
        for output in self.outputs.values():
            if output.codec != "H264" and output.targets:
                self._drop(UnsupportedCodecError.name)
        output = self.outputs["H264"]
        frame = EncodedFrame(
            media.payload,
            packetise_h264,
            keyframe=media.keyframe,
            marker=True,
            stamp=media.stamp,
            capture_time=output.monotone(capture_time),
            media_time=self._clock.timestamp(media.time),
        )
        if not frame.payloads(trailer=False):
            self._drop(PayloadError.name)
        elif output.targets:
            self._publish(output, frame)

    def _next_job(self) -> PictureJob | None:
        if self._newest is None:
            return None
        media, now, capture_time = self._newest
        self._newest = None
        orders = [
            Order(output, output.keyframes.take(now), output.variants(), output.monotone(capture_time))
            for output in self.outputs.values()
            if output.targets
        ]
        return PictureJob(media, self._clock.timestamp(media.time), orders)

    def _work(self, job: PictureJob) -> list[Encoded]:
        needed = {order.output.codec for order in job.orders}
        self._encoders = {codec: encoder for codec, encoder in self._encoders.items() if codec in needed}
        if not job.orders:
            return []
        try:
            picture = self._decoder.decode(job.media)
        except MediaError as error:
            return [Encoded(order.output, (), 0.0, error) for order in job.orders]
        return [self._encode(job, order, picture) for order in job.orders]

    def _encode(self, job: PictureJob, order: Order, picture: av.VideoFrame) -> Encoded:
        started = time.perf_counter()
        codec = order.output.codec
        encoder = self._encoders.get(codec)
        if encoder is None:
            encoder = create_picture_encoder(codec, self._settings.video_bitrate_bps, self._frame_rate)
            self._encoders[codec] = encoder
        try:
            encoded = encoder.encode(picture, job.media_time, order.keyframe)
        except MediaError as error:
            return Encoded(order.output, (), 0.0, error)
        self._picture_id = (self._picture_id + 1) & 0x7FFF
        frame = EncodedFrame(
            encoded.data,
            packetise_h264 if codec == "H264" else partial(packetise_vp8, picture_id=self._picture_id),
            keyframe=encoded.keyframe,
            marker=True,  # the last packet of a picture
            stamp=job.media.stamp,
            capture_time=order.capture_time,
            media_time=job.media_time,
        )
        for trailer in order.variants:
            frame.payloads(trailer)
        return Encoded(order.output, (frame,), time.perf_counter() - started)
