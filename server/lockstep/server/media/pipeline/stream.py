"""The common base of camera and microphone streams."""

import asyncio
import logging
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Generic, Literal, TypeVar

from lockstep.protocol.messages import Media
from lockstep.protocol.serial import event_gap
from lockstep.robot_bridge.thread_name import name_thread
from lockstep.rtc.token_bucket import TokenBucket
from lockstep.server.media.errors import MediaError
from lockstep.server.media.metrics import MediaMetrics
from lockstep.server.media.pipeline.fanout import FanOut
from lockstep.server.media.pipeline.frame import EncodedFrame
from lockstep.server.media.pipeline.keyframes import KeyframeScheduler
from lockstep.server.media.pipeline.recorded_encoding import RecordedEncoding
from lockstep.server.media.pipeline.tier_encoding import TierEncoding
from lockstep.server.media.quality.encoding_target import EncodingTarget, PictureTier
from lockstep.server.media.settings import MediaSettings
from lockstep.server.media.subscription import Subscription
from lockstep.server.util.cooperative_scheduler import CooperativeScheduler, turns_of_loop

__all__ = ["Encoded", "Stream"]

logger = logging.getLogger(__name__)

MAX_RATE = 240.0  # Hz, of media of one stream; sending each of them costs the loop that all robots share
MAX_AT_ONCE = 240.0  # media, after a network that has held them back

Job = TypeVar("Job")


class Encoded:
    """The worker's result for one output."""

    __slots__ = ("error", "frames", "output", "seconds", "whole")

    def __init__(
        self,
        output: TierEncoding,
        frames: Sequence[EncodedFrame],
        seconds: float,
        error: MediaError | None = None,
        *,
        whole: bool = True,
    ) -> None:
        self.output = output
        self.frames = frames
        self.seconds = seconds
        self.error = error
        self.whole = whole  # False: the worker keeps part of its input for the next frame


class Stream(ABC, Generic[Job]):
    """Feeds one worker thread and hands the encoded frames to the fan-out.

    `feed` and everything but `_work` run on the event loop; `_work` alone touches decoders and encoders.
    """

    kind: Literal["video", "audio"]
    codecs: tuple[str, ...]

    def __init__(self, name: str, label: str, settings: MediaSettings, fan_out: FanOut, metrics: MediaMetrics) -> None:
        self.name = name
        self.label = label
        self._settings = settings
        self._fan_out = fan_out
        self._metrics = metrics
        self._last_stamp: int | None = None
        self._rate = TokenBucket(MAX_RATE, MAX_AT_ONCE)
        self._reported = False  # True after the first failure of the worker
        self._works = False  # True while the worker has a job
        self._turns: CooperativeScheduler | None = None  # None: not running
        self._thread = ThreadPoolExecutor(
            1, thread_name_prefix=f"media-{name}", initializer=name_thread, initargs=(f"media-{name}",)
        )
        self._peers = metrics.peers.labels(name)
        self._frames_in = metrics.frames_in.labels(name)
        self._outputs: dict[tuple[str, PictureTier], TierEncoding] = {}
        self._members: dict[Subscription, None] = {}  # an ordered set
        self._recorded: RecordedEncoding | None = None  # None: nothing is recorded

    @property
    def full_plan(self) -> EncodingTarget:
        """The best encoding target that a tier can get."""
        return EncodingTarget(self._settings.video_bitrate_bps, 1.0)

    @property
    def outputs(self) -> Mapping[tuple[str, PictureTier], TierEncoding]:
        """The existing outputs, by codec and tier."""
        return self._outputs

    @property
    def passed(self) -> TierEncoding | None:
        """The output of pictures passed on as the source encoded them, while it gives such; None for most streams."""
        return None

    def record(self, recorded: RecordedEncoding | None) -> None:
        """Hand the encoding that `recorded` chooses to it from now on; None stops recording."""
        if self._recorded is not None:
            self._recorded.close()
        self._recorded = recorded

    def record_keyframe(self) -> None:
        """Request a keyframe for a new file of the recording."""
        if self._recorded is not None:
            self._recorded.request_keyframe()

    def output(self, codec: str, tier: PictureTier) -> TierEncoding:
        """Return an output, created by the first call for it; it costs nothing while it has no targets."""
        found = self._outputs.get((codec, tier))
        if found is None:
            settings = self._settings
            keyframes = KeyframeScheduler(settings.keyframe_interval_seconds, settings.keyframe_spacing_seconds)
            found = TierEncoding(self.name, codec, tier, self.full_plan, keyframes, self._metrics)
            self._outputs[codec, tier] = found
        return found

    def codec_in_use(self, wanted: str = "") -> str:
        """Return `wanted` if available; else a codec that is already encoded for peers, or the best one."""
        if wanted in self.codecs:
            return wanted
        return next((output.codec for output in self._outputs.values() if output.targets), self.codecs[0])

    def outputs_of(self, tier: PictureTier) -> list[TierEncoding]:
        """Return the existing outputs of a tier, in all codecs."""
        return [output for output in self._outputs.values() if output.tier == tier]

    def join(self, codec: str, target: Subscription, tier: PictureTier = "operator") -> None:
        self.output(codec, tier).join(target)
        self._members[target] = None
        self._peers.inc()

    def move(self, codec: str, target: Subscription, tier: PictureTier) -> None:
        """Give `target` another tier, from that tier's next keyframe on.

        Does nothing for a target that has left or is in that tier, except to cancel its pending move to another.
        """
        if target not in self._members:
            return
        source = next((each for each in self._outputs.values() if target in each.targets), None)
        for each in self._outputs.values():
            each.arriving.pop(target, None)
        if source is not None and source.tier != tier:
            self.output(codec, tier).expect(target, source)

    def request_keyframe(self, codec: str, target: Subscription, cause: str) -> None:
        """Request a keyframe for `target`; see `TierEncoding.request_keyframe`."""
        for output in self._outputs.values():
            if target in output.targets:
                output.request_keyframe(cause)

    def leave(self, target: Subscription) -> None:
        """Remove a target. Idempotent."""
        if target in self._members:
            del self._members[target]
            self._peers.dec()
        for output in self._outputs.values():
            output.leave(target)
        self._fan_out.forget(target)

    def feed(self, media: Media, now: float, capture_time: float) -> None:
        """Take a medium. `capture_time` is in s since 1970."""
        self._frames_in.inc()
        if not self._rate.take(now):
            self._drop("too_often")
            return
        # Without an H.264 picture, none that builds on it could be decoded; a stamp older than the last is still true.
        in_order = media.codec == "h264" or self._last_stamp is None
        if not in_order and event_gap(media.stamp, self._last_stamp or media.stamp) < 0:
            self._drop("stale_stamp")
            return
        self._last_stamp = media.stamp
        if self._recorded is not None:
            self._recorded.choose(self)
        if self._members or self._recorded is not None or media.codec == "h264":  # the next keyframe may be far
            self._enqueue(media, now, capture_time)

    def _drop(self, stage: str, count: int = 1) -> None:
        self._metrics.dropped.labels(self.name, stage).inc(count)

    def _publish(self, output: TierEncoding, frame: EncodedFrame) -> None:
        output.count(frame)
        self._admit(output, frame)
        self._fan_out.publish(frame, output.targets)
        if self._recorded is not None:
            self._recorded.published(self.name, output, frame)

    def _admit(self, output: TierEncoding, frame: EncodedFrame) -> None:
        """Let targets that come from another tier begin with this frame, if they can."""
        if frame.keyframe and output.arriving:
            output.arrive()

    async def run(self) -> None:
        """Encode until cancelled."""
        self._turns = turns_of_loop()
        try:
            self._begin_next()
            await asyncio.get_running_loop().create_future()
        finally:
            self._turns = None
            await asyncio.to_thread(self._thread.shutdown)

    def _begin_next(self) -> None:
        """Give the worker its next job, unless it is busy."""
        if self._turns is not None and not self._works and (job := self._next_job()) is not None:
            self._works = True
            self._thread.submit(self._work_and_tell, job, self._turns)

    def _work_and_tell(self, job: Job, turns: CooperativeScheduler) -> None:
        """Run a job in the thread. Its results go out at once, without waiting for a task's turn."""
        try:
            tell = partial(self._worked, self._work(job))
        except Exception as error:  # unexpected error of a codec library; the stream must go on
            tell = partial(self._worked, (), error)
        turns.call_from_thread(tell)

    def _worked(self, results: Sequence[Encoded], error: Exception | None = None) -> None:
        self._works = False
        if self._turns is None:  # ended meanwhile
            return
        try:
            if error is not None:
                self._failed(error)
            for encoded in results:
                self._finish(encoded)
        finally:
            self._begin_next()

    def _failed(self, error: Exception) -> None:
        if not self._reported:
            text = "stream %s: the worker failed; further failures are only counted"
            logger.error(text, self.name, exc_info=error)
        self._reported = True
        self._drop("worker_failed")
        for output in self._outputs.values():
            output.keyframes.request()

    def _finish(self, encoded: Encoded) -> None:
        if encoded.error is not None:
            self._drop(encoded.error.name)
            encoded.output.keyframes.request()  # it may have been a keyframe that somebody waits for
        else:
            encoded.output.encode_seconds.observe(encoded.seconds)
        for frame in encoded.frames:
            self._publish(encoded.output, frame)

    @abstractmethod
    def _enqueue(self, media: Media, now: float, capture_time: float) -> None:
        """Keep a medium for the worker; never blocks."""

    @abstractmethod
    def _next_job(self) -> Job | None:
        """Return the worker's next job, decided now; None when there is none."""

    @abstractmethod
    def _work(self, job: Job) -> list[Encoded]:
        """Do a job in the stream's thread. Raises nothing: errors of media come back as results."""
