"""The stream of a camera: the newest picture is encoded once per tier and codec in use."""

import time
from typing import NamedTuple

import av

from lockstep.protocol.description import Camera
from lockstep.protocol.messages import Media
from lockstep.server.media.codecs.group_of_pictures import GroupOfPictures
from lockstep.server.media.codecs.packetise import packetise_h264, packetise_vp8
from lockstep.server.media.codecs.picture import PictureDecoder
from lockstep.server.media.codecs.picture_encoder import VIDEO_CODECS, PictureEncoder, create_picture_encoder
from lockstep.server.media.errors import MediaError, PayloadError
from lockstep.server.media.metrics import MediaMetrics
from lockstep.server.media.pipeline.fanout import FanOut
from lockstep.server.media.pipeline.frame import EncodedFrame
from lockstep.server.media.pipeline.frame_rate_limiter import FrameRateLimiter
from lockstep.server.media.pipeline.media_clock import PictureClock
from lockstep.server.media.pipeline.passthrough import PASSED, Passthrough
from lockstep.server.media.pipeline.stream import Encoded, Stream
from lockstep.server.media.pipeline.tier_encoding import TierEncoding
from lockstep.server.media.quality.encoding_target import EncodingTarget, PictureTier
from lockstep.server.media.settings import MediaSettings
from lockstep.server.media.subscription import Subscription

__all__ = ["VideoStream"]

PACKETISE = {"H264": packetise_h264, "VP8": packetise_vp8}
# A camera gives nothing when no picture came for so long, and at least so many in a row are missing.
QUIET_SECONDS, QUIET_PICTURES = 2.0, 3


class SourcePicture:
    """A picture from the robot, decoded and resized at most once for all outputs."""

    def __init__(self, media: Media, capture_time: float, media_time: int, group: tuple[Media, ...] = ()) -> None:
        """`group`: the pictures to decode for it, if it builds on others."""
        self.media = media
        self._group = group
        self.capture_time = capture_time
        self.media_time = media_time
        self._sizes: dict[tuple[int, int], av.VideoFrame] = {}
        self._whole: av.VideoFrame | None = None
        self._error: MediaError | None = None

    def frame(self, decoder: PictureDecoder, plan: EncodingTarget) -> av.VideoFrame:
        """Return the picture in the size of `plan`. Runs in the stream's thread; raises MediaError."""
        if self._error is not None:
            raise self._error
        if self._whole is None:
            try:
                self._whole = decoder.decode(self.media, self._group)
            except MediaError as error:
                self._error = error
                raise
        whole = self._whole
        size = plan.size(whole.width, whole.height)
        if size == (whole.width, whole.height):
            return whole
        if size not in self._sizes:
            self._sizes[size] = whole.reformat(*size, interpolation="AREA")
        return self._sizes[size]


class PictureJob(NamedTuple):
    """One picture for one output."""

    source: SourcePicture
    output: TierEncoding
    plan: EncodingTarget
    keyframe: bool
    variants: frozenset[bool]  # with and without trailer, to be packetised in the worker
    capture_time: float
    needed: frozenset[TierEncoding]  # outputs that keep their encoders

    @property
    def media(self) -> Media:
        return self.source.media


class VideoStream(Stream[PictureJob]):
    """Encodes yuv420p, mjpeg and h264 to H.264 and VP8; h264 is passed on unchanged where possible (`Passthrough`).

    The operator's tier is encoded first and sent before the next one begins. When the encoders are too slow for all
    tiers a newer picture takes the place of an older one, and the tier that waited longest comes next.
    """

    kind = "video"
    codecs = VIDEO_CODECS

    def __init__(self, camera: Camera, settings: MediaSettings, fan_out: FanOut, metrics: MediaMetrics) -> None:
        self.frame_rate = min(camera.frame_rate, settings.video_frames_per_second or camera.frame_rate)
        self.size = camera.width, camera.height  # of the newest picture
        self.gives: str | None = None  # codec of the camera; None before the first picture
        self._came_at: float | None = None  # arrival of the newest picture, on the clock of `feed`
        super().__init__(camera.name, camera.label, settings, fan_out, metrics)
        self._clock = PictureClock()
        self._pace = FrameRateLimiter(settings.video_frames_per_second)
        self._newest: tuple[Media, float, float] | None = None  # medium, now, capture time
        self._source: SourcePicture | None = None  # of the orders
        self._orders: list[TierEncoding] = []  # outputs still to be encoded from it
        self._began = 0.0  # arrival of that picture
        self._others_served = 0  # observers' tiers that were encoded from it
        self._taken = metrics.taken.labels(camera.name)
        self._decoder = PictureDecoder()
        self._group = GroupOfPictures()
        self._passing = Passthrough(self.output(PASSED, "operator"), lambda tier: self.output("H264", tier))
        self._encoders: dict[TierEncoding, PictureEncoder] = {}
        self._open = {codec: metrics.encoders.labels(camera.name, codec) for codec in VIDEO_CODECS}

    @property
    def full_plan(self) -> EncodingTarget:
        return EncodingTarget(self._settings.video_bitrate_bps, self.frame_rate)

    def is_giving(self, now: float) -> bool:
        """True while pictures come. A camera that gives none, or none any more, needs no share of a path."""
        patience = max(QUIET_SECONDS, QUIET_PICTURES / self.frame_rate)
        return self._came_at is not None and now - self._came_at < patience

    def feed(self, media: Media, now: float, capture_time: float) -> None:
        self.gives = media.codec
        self._came_at = now
        super().feed(media, now, capture_time)

    def _enqueue(self, media: Media, now: float, capture_time: float) -> None:
        if media.codec == "h264":
            self._take_h264(media, capture_time)
            if not any(output.needed for output in self._ours()):
                return
        elif self._passing.profile is not None:
            self._passing.end()
        if not self._pace.admit(media.time):
            self._drop("thinned")
            return
        if media.width > 0 and media.height > 0:
            self.size = media.width, media.height
        if self._newest is not None:
            self._drop("encoder_busy")
        self._newest = media, now, capture_time
        self._begin_next()

    def _take_h264(self, media: Media, capture_time: float) -> None:
        """Pass on a picture that the camera encoded, and keep it for the decoder."""
        if media.keyframe:
            self._passing.begin(media, self._ours("H264"))
        self._group.add(media)
        self._passing.came(media)
        if media.width > 0 and media.height > 0:
            self.size = media.width, media.height
        output = self._passing.output
        if not output.needed:
            return
        frame = EncodedFrame(
            media.payload,
            packetise_h264,
            keyframe=media.keyframe,
            marker=True,
            stamp=media.stamp,
            capture_time=output.monotone(capture_time),
            media_time=self._clock.timestamp(media.time),
            time=media.time,
        )
        if not frame.payloads(trailer=False):
            self._drop(PayloadError.name)
            return
        self._publish(output, frame)

    def _ours(self, codec: str | None = None) -> list[TierEncoding]:
        """Return the outputs that the console encodes, of one codec or all."""
        passed = self._passing.output
        return [each for each in self._outputs.values() if each is not passed and codec in (None, each.codec)]

    def join(self, codec: str, target: Subscription, tier: PictureTier = "operator") -> None:
        self._passing.place(target, tier)
        super().join(codec, target, tier)

    def move(self, codec: str, target: Subscription, tier: PictureTier) -> None:
        self._passing.place(target, tier)
        if not self._passing.holds(target):
            super().move(codec, target, tier)

    def request_keyframe(self, codec: str, target: Subscription, cause: str) -> None:
        if self._passing.holds(target):
            self._passing.output.request_keyframe(cause)  # to be counted
            self._passing.return_to_ours(target)
        else:
            super().request_keyframe(codec, target, cause)

    def hold_back(self, target: Subscription, wanted: bool) -> None:
        """Set whether `target` must not get the camera's own H.264, because its path has no room."""
        self._passing.hold_back(target, wanted)

    @property
    def passed(self) -> TierEncoding | None:
        return None if self._passing.profile is None else self._passing.output

    def measured(self, target: Subscription) -> tuple[float, float] | None:
        """Return the pictures and bits per second of the camera's own H.264, if `target` gets that."""
        return self._passing.measured if self._passing.holds(target) else None

    def leave(self, target: Subscription) -> None:
        self._passing.leave(target)
        super().leave(target)

    def _next_job(self) -> PictureJob | None:
        if self._newest is not None and (not self._orders or self._others_served > 0):
            self._take_newest()
        while self._orders:
            output = self._orders.pop(0)
            if output.needed and self._source is not None:
                return self._job(self._source, output)
        return None if self._newest is None else self._next_job()

    def _take_newest(self) -> None:
        """Begin the newest picture; give up the tiers for which the one before was not encoded."""
        if self._newest is None:
            return
        media, now, capture_time = self._newest
        self._newest = None
        if self._orders:
            self._drop("encoder_busy", len(self._orders))
        self._began, self._others_served = now, 0
        due = [output for output in self._ours() if self._due(output, media.time, now)]
        group = self._group.take() if media.codec == "h264" and due else ()
        self._source = SourcePicture(media, capture_time, self._clock.timestamp(media.time), group)
        self._taken.inc(bool(due))
        self._orders = sorted(due, key=lambda output: (output.tier != "operator", output.encoded_at))

    def _due(self, output: TierEncoding, time: float, now: float) -> bool:
        if not output.needed or not output.cadence.take(time, output.plan.frame_rate, self.frame_rate):
            return False
        if now < output.paused_until or output.held_up:
            self._drop("path_busy")
            return False
        return True

    def _job(self, source: SourcePicture, output: TierEncoding) -> PictureJob:
        output.encoded_at = self._began
        self._others_served += output.tier != "operator"
        return PictureJob(
            source,
            output,
            output.plan,
            output.keyframes.take(self._began),
            output.variants(),
            output.monotone(source.capture_time),
            frozenset(each for each in self._outputs.values() if each.needed),
        )

    def _work(self, job: PictureJob) -> list[Encoded]:
        if not self._encoders.keys() <= job.needed:
            self._encoders = {output: encoder for output, encoder in self._encoders.items() if output in job.needed}
            self._count_encoders()
        started = time.perf_counter()
        output, source = job.output, job.source
        try:
            encoder = self._encoder(output, job.plan)
            frame = source.frame(self._decoder, job.plan)
            encoded = encoder.encode(frame, source.media_time, job.keyframe)
        except MediaError as error:
            return [Encoded(output, (), 0.0, error)]
        packed = EncodedFrame(
            encoded.data,
            PACKETISE[output.codec],
            keyframe=encoded.keyframe,
            marker=True,  # the last packet of a picture
            stamp=source.media.stamp,
            capture_time=job.capture_time,
            media_time=source.media_time,
            time=source.media.time,
        )
        for trailer in job.variants:
            packed.payloads(trailer)
        return [Encoded(output, (packed,), time.perf_counter() - started)]

    def _encoder(self, output: TierEncoding, plan: EncodingTarget) -> PictureEncoder:
        encoder = self._encoders.get(output)
        if encoder is None:
            encoder = create_picture_encoder(output.codec, plan.bitrate_bps, plan.frame_rate)
            self._encoders[output] = encoder
            self._count_encoders()
        encoder.aim(plan.bitrate_bps, plan.frame_rate)
        return encoder

    def _count_encoders(self) -> None:
        for codec, gauge in self._open.items():
            gauge.set(sum(output.codec == codec for output in self._encoders))
