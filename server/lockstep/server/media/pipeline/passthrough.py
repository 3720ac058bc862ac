"""The stage that passes H.264 which a camera has encoded, unchanged, to the peers that can take it.

| peer | gets |
|---|---|
| negotiated H.264 of a profile that holds the camera's | the camera's own pictures, from its next keyframe on |
| the same, until that keyframe, and after a lost picture: cameras take no keyframe requests | the console's encoding |
| the same, while its path shows a limit: the camera's pictures cannot be made smaller | the console's encoding |
| VP8, or H.264 of a smaller profile | the console's encoding |
"""

import time
from collections import deque

from lockstep.protocol.messages import Media
from lockstep.server.media.codecs.group_of_pictures import GroupOfPictures
from lockstep.server.media.codecs.h264 import Profile, accepts, inspect
from lockstep.server.media.codecs.packetise import packetise_h264
from lockstep.server.media.encoding.stream_encodings import StreamEncodings
from lockstep.server.media.encoding.tier_encoding import TierEncoding
from lockstep.server.media.errors import PayloadError
from lockstep.server.media.metrics import DropCounter
from lockstep.server.media.pipeline.frame import EncodedFrame
from lockstep.server.media.pipeline.media_clock import PictureClock
from lockstep.server.media.pipeline.picture_timing import PictureTiming
from lockstep.server.media.pipeline.stage import FrameStage, SourceFrame
from lockstep.server.media.subscription import Subscription

__all__ = ["Passthrough"]

MEASURED_SECONDS, MOST_MEASURED = 2.0, 240


class Passthrough(FrameStage):
    """Makes encoded frames of a camera's H.264, and passes the pictures on only if the console has to encode them."""

    def __init__(
        self,
        following: FrameStage,
        encodings: StreamEncodings,
        passed: TierEncoding,
        clock: PictureClock,
        group: GroupOfPictures,
        dropped: DropCounter,
    ) -> None:
        """`passed`: the camera's own encoding. `group` keeps its pictures for the decoder."""
        super().__init__(following)
        self._encodings = encodings
        self._passed = passed
        self._clock = clock
        self._group = group
        self._dropped = dropped
        self._profile: Profile | None = None  # of the camera's pictures; None while it gives no H.264
        self._recent: deque[tuple[float, int]] = deque()  # time of capture and bytes

    def source(self, frame: SourceFrame) -> None:
        if frame.media.codec == "h264":
            self._pass(frame)
            if not any(each.needed for each in self._encodings.own):
                return
        elif self._profile is not None:
            self._end()
        super().source(frame)

    def _pass(self, frame: SourceFrame) -> None:
        media = frame.media
        if media.keyframe:
            self._begin(media)
        self._group.add(media)
        self._measure(media)
        if not self._passed.needed:
            return
        encoded = EncodedFrame(
            media.payload,
            packetise_h264,
            keyframe=media.keyframe,
            marker=True,
            stamp=media.stamp,
            capture_time=self._passed.monotone(frame.capture_time),
            media_time=self._clock.timestamp(media.time),
            time=media.time,
        )
        whole = bool(encoded.payloads(trailer=False))
        at = frame.arrived_at  # nothing is encoded here: from its arrival on it is being packetised
        encoded.timing = PictureTiming(media.spans, at, at, at, time.monotonic())
        if whole:
            self.following.encoded(encoded, self._passed)
        else:
            self._dropped.count(PayloadError.name)

    def _measure(self, media: Media) -> None:
        self._recent.append((media.time, len(media.payload)))
        while len(self._recent) > MOST_MEASURED or media.time - self._recent[0][0] > MEASURED_SECONDS:
            self._recent.popleft()

    def measured(self, target: Subscription) -> tuple[float, float] | None:
        """Return the pictures and bits per second of the last two seconds, if `target` gets the camera's own H.264.

        Both are 0 while they are not known.
        """
        if target not in self._passed.targets:
            return None
        span = self._recent[-1][0] - self._recent[0][0] if self._recent else 0.0
        if span <= 0:
            return 0.0, 0.0
        return (len(self._recent) - 1) / span, 8 * sum(size for _, size in self._recent) / span

    def hold_back(self, target: Subscription, wanted: bool) -> None:
        """Set whether `target` must get the console's encoding, because its path has no room."""
        if wanted and not target.held_back and target in self._passed.targets:
            self._encodings.return_to_own(target)
        target.held_back = wanted

    def _begin(self, keyframe: Media) -> None:
        """Take a keyframe of the camera: targets that can decode it move here, those that no longer can move back."""
        access = inspect(keyframe.payload)
        if access.profile is not None:
            self._profile = access.profile
        self._encodings.passes = self._profile is not None
        for target in list(self._passed.targets):
            if not self._may_pass_to(target):
                self._encodings.return_to_own(target)
        for encoding in [each for each in self._encodings.own if each.codec == "H264"]:
            for target in [*encoding.targets, *encoding.arriving]:
                if self._may_pass_to(target):
                    encoding.leave(target)
                    self._passed.targets[target] = None

    def _end(self) -> None:
        """Move all targets to the console's encoding, from a keyframe on: the camera gives other pictures now."""
        self._profile = None
        self._encodings.passes = False
        for target in list(self._passed.targets):
            self._encodings.return_to_own(target)

    def _may_pass_to(self, target: Subscription) -> bool:
        negotiated = target.h264
        if negotiated is None or self._profile is None or target.held_back:
            return False
        return accepts(negotiated, self._profile)
