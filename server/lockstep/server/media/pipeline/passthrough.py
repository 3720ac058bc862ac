"""The stage that passes H.264 which a camera has encoded, unchanged, to the peers that can take it.

| peer | gets |
|---|---|
| negotiated H.264 of a profile that holds the camera's | the camera's own pictures, from its next keyframe on |
| the same, until that keyframe, and after a lost picture: cameras take no keyframe requests | the console's encoding |
| the same, while its path shows a limit: the camera's pictures cannot be made smaller | the console's encoding |
| VP8, or H.264 of a smaller profile | the console's encoding |

A robot bridge that encodes as it is asked makes keyframes, and fits the operator's path: its pictures are then passed
on from the beginning, and after a lost picture the bridge is asked instead.
"""

from collections import deque

from lockstep.protocol.messages import Media
from lockstep.server.media.codecs.group_of_pictures import GroupOfPictures
from lockstep.server.media.codecs.h264 import Profile, accepts, holds_slice, inspect
from lockstep.server.media.encoding.robot_keyframes import RobotKeyframes
from lockstep.server.media.encoding.stream_encodings import StreamEncodings
from lockstep.server.media.encoding.tier_encoding import TierEncoding
from lockstep.server.media.errors import PayloadError
from lockstep.server.media.metrics import DropCounter
from lockstep.server.media.pipeline.access_unit import is_access_unit, passed_frame
from lockstep.server.media.pipeline.media_clock import PictureClock
from lockstep.server.media.pipeline.stage import FrameStage, SourceFrame
from lockstep.server.media.subscription import Subscription

__all__ = ["Passthrough"]

MEASURED_SECONDS, MOST_MEASURED = 2.0, 240


class Passthrough(FrameStage):
    """Makes encoded frames of a camera's H.264, and passes the pictures on only if the console has to encode them.

    Attributes:
        keyframes: requests of keyframes from a robot bridge that encodes
    """

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
        self.keyframes = RobotKeyframes(encodings, passed)
        self._encodings = encodings
        self._passed = passed
        self._clock = clock
        self._group = group
        self._dropped = dropped
        self._profile: Profile | None = None  # of the camera's pictures; None while it gives no H.264
        self._recent: deque[tuple[float, int]] = deque()  # time of capture and bytes
        self._broken = False  # a picture is missing: those up to the next keyframe cannot be decoded

    def lost(self) -> None:
        """A picture was dropped before this stage: pass none on that may build on it."""
        self._broken = True
        self._passed.request_keyframe("drop")

    def source(self, frame: SourceFrame) -> None:
        if frame.media.codec == "h264":
            if not self._is_whole(frame.media):
                return
            self._pass(frame)
            self.keyframes.serve(frame.arrived_at)
            if not holds_slice(frame.media.payload):
                return  # the decoder gets it with the next picture
            if not any(self._needs_console(each) for each in self._encodings.own):
                return
        elif self._profile is not None:
            self._end()
        super().source(frame)

    def _is_whole(self, media: Media) -> bool:
        """Return whether the picture can be decoded, as far as its bytes and those before it show."""
        if not is_access_unit(media.payload):
            self._dropped.count(PayloadError.name)
            self.lost()
            return False
        if media.keyframe:
            self._broken = False
        elif self._broken:
            self._dropped.count("no_reference")
        return not self._broken

    def _needs_console(self, encoding: TierEncoding) -> bool:
        """Return whether the console has to make an encoding, because the robot's next keyframe does not replace it."""
        if not encoding.needed or not self._encodings.follows:
            return encoding.needed
        if encoding.codec != "H264" or encoding.recorded:
            return True
        return not all(map(self._may_pass_to, (*encoding.targets, *encoding.arriving)))

    def _pass(self, frame: SourceFrame) -> None:
        media = frame.media
        if media.keyframe:
            ahead = self._begin(media)
            self.keyframes.came(frame.arrived_at)
            if ahead:
                self._passed.keyframes.join(other=all(map(self._encodings.is_other, ahead)))
        self._group.add(media)
        self._measure(media)
        if not self._passed.needed:
            return
        if (encoded := passed_frame(frame, self._clock.timestamp(media.time), self._passed)) is None:
            self._dropped.count(PayloadError.name)
        else:
            self.following.encoded(encoded, self._passed)

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
        if wanted and not target.held_back and self._encodings.is_passed_to(target):
            self._encodings.return_to_own(target)
        target.held_back = wanted

    def _begin(self, keyframe: Media) -> list[Subscription]:
        """Take a keyframe of the camera: targets that can decode it move here, those that no longer can move back.

        Return those that wait for the next, because they have had a later picture of a second encoding.
        """
        ahead = []
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
                    if target.is_ahead_of(keyframe.stamp):
                        ahead.append(target)
                        continue
                    for each in self._encodings:
                        each.leave(target)
                    self._passed.targets[target] = None
        return ahead

    def _end(self) -> None:
        """Move all targets to the console's encoding, from a keyframe on: the camera gives other pictures now."""
        self._profile = None
        self._encodings.passes = self._encodings.follows = False
        for target in list(self._passed.targets):
            self._encodings.return_to_own(target)

    def _may_pass_to(self, target: Subscription) -> bool:
        negotiated = target.h264
        if negotiated is None or self._profile is None or target.held_back:
            return False
        return accepts(negotiated, self._profile)
