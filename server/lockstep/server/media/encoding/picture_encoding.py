"""Chooses the next picture of a camera to encode: the newest, once for each tier and codec that somebody needs."""

import time
from collections.abc import Sequence
from typing import NamedTuple

import av
from prometheus_client import Counter

from lockstep.protocol.messages import Media
from lockstep.server.media.codecs.group_of_pictures import GroupOfPictures
from lockstep.server.media.codecs.packetise import packetise_h264, packetise_vp8
from lockstep.server.media.codecs.picture import PictureDecoder
from lockstep.server.media.codecs.picture_encoder import VIDEO_CODECS, PictureEncoder, create_picture_encoder
from lockstep.server.media.encoding.encoder_worker import Encoded
from lockstep.server.media.encoding.stream_encodings import StreamEncodings
from lockstep.server.media.encoding.tier_encoding import TierEncoding
from lockstep.server.media.errors import MediaError
from lockstep.server.media.metrics import DropCounter, MediaMetrics
from lockstep.server.media.pipeline.frame import EncodedFrame
from lockstep.server.media.pipeline.media_clock import PictureClock
from lockstep.server.media.pipeline.picture_span_times import PictureSpanTimes
from lockstep.server.media.pipeline.stage import SourceFrame
from lockstep.server.media.quality.encoding_target import EncodingTarget

__all__ = ["PictureJob", "PictureQueue", "TierEncoders"]

PACKETISE = {"H264": packetise_h264, "VP8": packetise_vp8}


class SourcePicture:
    """A picture of the source, decoded and resized at most once for all encodings."""

    def __init__(self, media: Media, capture_time: float, media_time: int, arrived: float = 0.0) -> None:
        """`arrived`: s, on the monotonic clock."""
        self.media = media
        self.arrived = arrived
        self.group: tuple[Media, ...] = ()  # the pictures to decode for it, if it builds on others
        self.capture_time = capture_time
        self.media_time = media_time
        self._sizes: dict[tuple[int, int], av.VideoFrame] = {}
        self._whole: av.VideoFrame | None = None
        self._error: MediaError | None = None

    def frame(self, decoder: PictureDecoder, plan: EncodingTarget) -> av.VideoFrame:
        """Return the picture in the size of `plan`. Runs in the worker's thread; raises MediaError."""
        if self._error is not None:
            raise self._error
        if self._whole is None:
            try:
                self._whole = decoder.decode(self.media, self.group)
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
    """One picture for one encoding."""

    source: SourcePicture
    encoding: TierEncoding
    plan: EncodingTarget
    keyframe: bool
    variants: frozenset[bool]  # with and without trailer, to be packetised in the worker
    capture_time: float
    needed: frozenset[TierEncoding]  # encodings that keep their encoders

    @property
    def media(self) -> Media:
        return self.source.media


class PictureQueue:
    """The newest picture of a camera, and the tiers for which it is still to be encoded. No I/O.

    The operator's tier is encoded first and sent before the next one begins. When the encoders are too slow for all
    tiers a newer picture takes the place of an older one, and the tier that waited longest comes next.
    """

    def __init__(
        self,
        encodings: StreamEncodings,
        frame_rate: float,
        clock: PictureClock,
        group: GroupOfPictures,
        taken: Counter,
        dropped: DropCounter,
    ) -> None:
        """`frame_rate`: the camera's. `group`: the pictures on which the newest one builds. `taken` counts pictures."""
        self._encodings = encodings
        self._frame_rate = frame_rate
        self._clock = clock
        self._group = group
        self._taken = taken
        self._dropped = dropped
        self._newest: SourceFrame | None = None
        self._source: SourcePicture | None = None  # of the orders
        self._orders: list[TierEncoding] = []  # encodings still to be made of it
        self._began = 0.0  # arrival of that picture
        self._others_served = 0  # observers' tiers that were encoded from it

    def put(self, frame: SourceFrame) -> None:
        if self._newest is not None:
            self._dropped.count("encoder_busy")
        self._newest = frame

    def next_job(self) -> PictureJob | None:
        """Return the next job, decided now; None when there is none."""
        while True:
            if self._newest is not None and (not self._orders or self._others_served > 0):
                self._take(self._newest)
            while self._orders:
                encoding = self._orders.pop(0)
                if encoding.needed and self._source is not None and self._can_decode(self._source):
                    return self._job(self._source, encoding)
            if self._newest is None:
                return None

    def _take(self, newest: SourceFrame) -> None:
        """Begin the newest picture; give up the tiers for which the one before was not encoded."""
        media, now, capture_time = newest
        self._newest = None
        if self._orders:
            self._dropped.count("encoder_busy", len(self._orders))
        self._began, self._others_served = now, 0
        due = [each for each in self._encodings.own if self._is_due(each, media.time, now)]
        self._source = SourcePicture(media, capture_time, self._clock.timestamp(media.time), now)
        self._taken.inc(bool(due))
        self._orders = sorted(due, key=lambda each: (each.tier != "operator", each.encoded_at))

    def _can_decode(self, source: SourcePicture) -> bool:
        """Take the pictures to decode for `source`; return False if that is not possible any more.

        Only with the job that decodes them: a picture that is taken and not decoded is missing to all those after it,
        up to the next keyframe.
        """
        if source.media.codec == "h264" and not source.group:
            source.group = self._group.take(source.media)
            if not source.group:
                self._dropped.count("no_reference")
                return False
        return True

    def _is_due(self, encoding: TierEncoding, time: float, now: float) -> bool:
        if not encoding.needed or not encoding.cadence.take(time, encoding.plan.frame_rate, self._frame_rate):
            return False
        if now < encoding.paused_until or encoding.held_up:
            self._dropped.count("path_busy")
            return False
        return True

    def _job(self, source: SourcePicture, encoding: TierEncoding) -> PictureJob:
        encoding.encoded_at = self._began
        self._others_served += encoding.tier != "operator"
        return PictureJob(
            source,
            encoding,
            encoding.plan,
            encoding.keyframes.take(self._began),
            encoding.variants(),
            encoding.monotone(source.capture_time),
            frozenset(each for each in self._encodings.own if each.needed),
        )


class TierEncoders:
    """The decoder of a camera's pictures and an encoder for each encoding in use; runs in the worker's thread."""

    def __init__(self, stream: str, metrics: MediaMetrics) -> None:
        self._decoder = PictureDecoder()
        self._encoders: dict[TierEncoding, PictureEncoder] = {}
        self._open = {codec: metrics.encoders.labels(stream, codec) for codec in VIDEO_CODECS}

    def encode(self, job: PictureJob) -> Sequence[Encoded]:
        if not self._encoders.keys() <= job.needed:
            self._encoders = {each: encoder for each, encoder in self._encoders.items() if each in job.needed}
            self._count_encoders()
        started = time.monotonic()
        encoding, source = job.encoding, job.source
        try:
            frame = source.frame(self._decoder, job.plan)  # first: later pictures build on it
            encoder = self._encoder(encoding, job.plan)
            encoded = encoder.encode(frame, source.media_time, job.keyframe)
        except MediaError as error:
            return [Encoded(encoding, (), error=error)]
        finished = time.monotonic()
        packed = EncodedFrame(
            encoded.data,
            PACKETISE[encoding.codec],
            keyframe=encoded.keyframe,
            marker=True,  # the last packet of a picture
            stamp=source.media.stamp,
            capture_time=job.capture_time,
            media_time=source.media_time,
            time=source.media.time,
        )
        for trailer in job.variants:
            packed.payloads(trailer)
        ended = time.monotonic()
        packed.timing = PictureSpanTimes(source.media.spans, source.arrived, started, finished, ended)
        return [Encoded(encoding, (packed,), ended - started)]

    def _encoder(self, encoding: TierEncoding, plan: EncodingTarget) -> PictureEncoder:
        encoder = self._encoders.get(encoding)
        if encoder is None:
            encoder = create_picture_encoder(encoding.codec, plan.bitrate_bps, plan.frame_rate)
            self._encoders[encoding] = encoder
            self._count_encoders()
        encoder.aim(plan.bitrate_bps, plan.frame_rate)
        return encoder

    def _count_encoders(self) -> None:
        for codec, gauge in self._open.items():
            gauge.set(sum(each.codec == codec for each in self._encoders))
