"""The stage that passes on a robot's second encoding of a camera: to observers who are due more than the operator."""

from collections.abc import Callable

from lockstep.protocol.messages import Media
from lockstep.server.media.codecs.h264 import accepts, inspect
from lockstep.server.media.encoding.stream_encodings import SECOND_TIERS, StreamEncodings
from lockstep.server.media.encoding.tier_encoding import TierEncoding
from lockstep.server.media.errors import PayloadError
from lockstep.server.media.metrics import DropCounter
from lockstep.server.media.pipeline.access_unit import is_access_unit, passed_frame
from lockstep.server.media.pipeline.media_clock import PictureClock
from lockstep.server.media.pipeline.stage import FrameStage, SourceFrame
from lockstep.server.media.subscription import Subscription

__all__ = ["SecondPassthrough"]


class SecondPassthrough(FrameStage):
    """Gives observers the second encoding from a keyframe of it on, and the first again when it ends."""

    def __init__(
        self,
        following: FrameStage,
        encodings: StreamEncodings,
        second: TierEncoding,
        clock: PictureClock,
        dropped: DropCounter,
    ) -> None:
        super().__init__(following)
        self._encodings = encodings
        self._second = second
        self._clock = clock
        self._dropped = dropped
        self._media_time = -1
        self._broken = True  # until a keyframe
        self._on = False  # it is asked for
        self._waiting: frozenset[Subscription] = frozenset()
        self.came: Callable[[float], None] = lambda now: None  # called with the time of each whole picture's arrival

    @property
    def is_due(self) -> bool:
        """True while somebody is due more than the operator's pictures, and could take them."""
        return self._encodings.follows and any(map(self._takes, self._all_targets()))

    def begin(self) -> None:
        """Take the pictures: they are asked for. Idempotent."""
        self._on = True

    def end(self) -> None:
        """Give all targets the first encoding again, from its next keyframe on. Idempotent."""
        self._on, self._broken = False, True
        self._waiting = frozenset()
        for target in list(self._second.targets):
            self._encodings.return_to_own(target)

    def wants_keyframe(self, now: float) -> bool:
        """Return whether the robot is to be asked for a keyframe now."""
        if not self._on:
            return False
        waiting = frozenset(filter(self._takes, self._all_targets())) - self._second.targets.keys()
        if waiting - self._waiting:
            self._second.keyframes.join()
        self._waiting = waiting
        return self._second.keyframes.take(now)

    def lost(self) -> None:
        """A picture was dropped: pass none on that may build on it."""
        if self._on and not self._broken:
            self._broken = True
            self._second.request_keyframe("drop")

    def source(self, frame: SourceFrame) -> None:
        media = frame.media
        if not self._on or media.codec != "h264":
            self._dropped.count("not_asked")
            return
        if not is_access_unit(media.payload):
            self._dropped.count(PayloadError.name)
            self.lost()
            return
        if media.keyframe:
            self._second.keyframes.served(frame.arrived_at)
            self._begin_with(media)
        elif self._broken:
            self._dropped.count("no_reference")
            return
        self.came(frame.arrived_at)
        if self._second.needed:
            self._pass(frame)

    def _begin_with(self, keyframe: Media) -> None:
        self._broken = False
        profile = inspect(keyframe.payload).profile
        for target in self._all_targets():
            takes = profile is not None and target.h264 is not None and accepts(target.h264, profile)
            if not takes or not self._takes(target) or target in self._second.targets:
                continue
            if target.is_ahead_of(keyframe.stamp):
                self._second.keyframes.join()
                continue
            for encoding in self._encodings:
                encoding.leave(target)
            self._second.targets[target] = None

    def _pass(self, frame: SourceFrame) -> None:
        self._media_time = max(self._media_time + 1, self._clock.place(frame.media.time))
        if (encoded := passed_frame(frame, self._media_time, self._second)) is None:
            self._dropped.count(PayloadError.name)
        else:
            self.following.encoded(encoded, self._second)

    def _all_targets(self) -> list[Subscription]:
        return list({each: None for encoding in self._encodings for each in (*encoding.targets, *encoding.arriving)})

    @staticmethod
    def _takes(target: Subscription) -> bool:
        return not target.priority and target.tier in SECOND_TIERS and not target.held_back and target.h264 is not None
