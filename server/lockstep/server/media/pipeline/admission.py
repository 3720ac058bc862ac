"""The first stage bounds how often frames may come, and ends the way of frames that nobody takes."""

from collections.abc import Callable
from typing import Protocol

from prometheus_client import Counter

from lockstep.protocol.serial import event_gap
from lockstep.rtc.token_bucket import TokenBucket
from lockstep.server.media.metrics import DropCounter
from lockstep.server.media.pipeline.stage import FrameStage, SourceFrame

__all__ = ["MAX_AT_ONCE", "Admission"]

MAX_RATE = 240.0  # Hz, of frames of one stream; sending each of them costs the loop that all robots share
MAX_AT_ONCE = 240.0  # frames, after a network that has held them back


class SecondStage(Protocol):
    """Takes the pictures of a robot's second encoding."""

    def source(self, frame: SourceFrame) -> None: ...

    def lost(self) -> None:
        """A picture was dropped on which others may build."""


class Admission(FrameStage):
    """Passes frames on that come in order and not too often, while somebody takes the stream.

    Attributes:
        newest: the newest frame that came in order and not too often; None before the first
        size: width and height of the newest picture that says them; None before the first
    """

    def __init__(
        self,
        following: FrameStage,
        choose: Callable[[], bool],
        arrived: Counter,
        dropped: DropCounter,
        on_lost: Callable[[], None] = lambda: None,
        second: SecondStage | None = None,
    ) -> None:
        """`choose` chooses what is recorded of the next frame, and returns whether somebody takes the stream. It is
        called for each frame. `on_lost` is called when a picture is dropped on which others may build. `second` takes
        the pictures of a robot's second encoding, which have a bound of their own; None: nobody does."""
        super().__init__(following)
        self.newest: SourceFrame | None = None
        self.size: tuple[int, int] | None = None
        self._choose = choose
        self._arrived = arrived
        self._on_lost = on_lost
        self._dropped = dropped
        self._rate = TokenBucket(MAX_RATE, MAX_AT_ONCE)
        self._second_rate = TokenBucket(MAX_RATE, MAX_AT_ONCE)  # the operator's pictures never pay for these
        self._last_stamp: int | None = None
        self._second = second

    def source(self, frame: SourceFrame) -> None:
        media = frame.media
        self._arrived.inc()
        if media.second:
            self._take_second(frame)
            return
        if not self._rate.take(frame.arrived_at):
            self._dropped.count("too_often")
            if media.codec == "h264":
                self._on_lost()
            return
        # Without an H.264 picture, none that builds on it could be decoded; a stamp older than the last is still true.
        in_order = media.codec == "h264" or self._last_stamp is None
        if not in_order and event_gap(media.stamp, self._last_stamp or media.stamp) < 0:
            self._dropped.count("stale_stamp")
            return
        self.newest, self._last_stamp = frame, media.stamp
        if media.width > 0 and media.height > 0:
            self.size = media.width, media.height
        is_taken = self._choose()
        if is_taken or media.codec == "h264":  # the camera's next keyframe may be far
            super().source(frame)

    def _take_second(self, frame: SourceFrame) -> None:
        second = self._second
        if second is None:
            self._dropped.count("not_asked")
        elif self._second_rate.take(frame.arrived_at):
            second.source(frame)
        else:
            self._dropped.count("too_often")
            second.lost()
