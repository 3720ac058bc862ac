"""Runs the robot's cameras and microphones: stamps what they capture, and sends it to the media links."""

import asyncio
import logging
import time
from collections.abc import Callable

import msgspec

from lockstep.protocol.messages import Media
from lockstep.protocol.traces.trace import PictureSpans, span_ms
from lockstep.robot_bridge.control.event_core import EventCore
from lockstep.robot_bridge.control.event_times import EventTimes
from lockstep.robot_bridge.control.feedback_issuer import FeedbackIssuer
from lockstep.robot_bridge.counters import BridgeCounters
from lockstep.robot_bridge.encoding.media_encoding import MediaEncoding
from lockstep.robot_bridge.event_log import EventLog
from lockstep.robot_bridge.link.sending.link_publisher import LinkPublisher
from lockstep.robot_bridge.robots.base import MediaSource, Robot, Stamp

__all__ = ["MediaSources"]

_logger = logging.getLogger(__name__)


class MediaSources:
    """All media sources of a robot. A source that fails is a fault of the robot, and does not end the bridge."""

    def __init__(
        self,
        robot: Robot,
        core: EventCore,
        feedback: FeedbackIssuer,
        publisher: LinkPublisher,
        counters: BridgeCounters,
        log: EventLog,
        *,
        event_strip: bool,
        encoding: MediaEncoding | None = None,
    ) -> None:
        """`event_strip`: draw the event into pictures, for measurements. `encoding`: encodes; None: nothing does."""
        self._robot = robot
        self._times = feedback.times
        self._stamper = _Stamper(core, feedback.times)
        self._feedback = feedback
        self._publisher = publisher
        self._counters = counters
        self._log = log
        self._mark = _marker() if event_strip else None
        self._encoding = encoding
        if encoding is not None:
            encoding.send_to(publisher)

    async def run(self) -> None:
        """Run the sources until cancelled, or until all have ended."""
        try:
            sources = list(self._robot.sources())
        except BaseException as error:
            self._failed(error)
            return
        async with asyncio.TaskGroup() as group:
            if self._encoding is not None:
                group.create_task(self._encoding.run())
            for source in sources:
                group.create_task(self._run(source))

    async def _run(self, source: MediaSource) -> None:
        try:
            await source.run(self._stamper, self._emit)
        except GeneratorExit:
            raise
        except BaseException as error:
            task = asyncio.current_task()
            if isinstance(error, asyncio.CancelledError) and task is not None and task.cancelling():
                raise
            self._failed(error)

    def _failed(self, error: BaseException) -> None:
        _logger.error("a media source failed: %s", error, exc_info=error)
        self._feedback.source_failed(f"media: {type(error).__name__}: {error}"[:200])

    def _emit(self, media: Media) -> None:
        self._counters.media += 1
        self._log.record("media", media.stamp, stream=media.stream, captured=media.time)
        if media.codec != "pcm_s16le":
            media = with_spans(media, self._times.began(media.stamp), time.monotonic())
        marked = media if self._mark is None else self._mark(media)
        if self._encoding is None:
            self._publisher.publish_media(marked)
        else:
            self._encoding.put(marked)


def with_spans(media: Media, event_began: float | None, now: float) -> Media:
    """Return a picture with its spans at this bridge; those that its source has measured itself stay as they are.

    Args:
        event_began: when the event of its stamp became current, s; None: not known
        now: s, when the picture is whole

    All times are on the bridge's monotonic clock.
    """
    own = PictureSpans() if media.spans is msgspec.UNSET else media.spans
    if own.camera_wait_ms is msgspec.UNSET and event_began is not None:
        own = msgspec.structs.replace(own, camera_wait_ms=span_ms(media.time - event_began))
    if own.capture_ms is msgspec.UNSET:
        encoding = 0.0 if own.bridge_encode_ms is msgspec.UNSET else own.bridge_encode_ms / 1000
        own = msgspec.structs.replace(own, capture_ms=span_ms(now - media.time - encoding))
    return msgspec.structs.replace(media, spans=own)


class _Stamper:
    def __init__(self, core: EventCore, times: EventTimes) -> None:
        self._core = core
        self._times = times

    def __call__(self) -> Stamp:
        return Stamp(self._core.current, time.monotonic())

    def at(self, time: float) -> Stamp | None:
        return self._times.at(time)


def _marker() -> Callable[[Media], Media]:
    """Drawing needs numpy, which a robot's own bridge may not have."""
    from lockstep.robot_bridge.robots.event_strip import with_event_strip

    return with_event_strip
