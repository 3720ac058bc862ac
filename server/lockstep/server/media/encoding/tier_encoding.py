"""One tier of one codec of one stream: its targets, its encoding target, and its keyframes."""

from lockstep.server.media.encoding.keyframes import KeyframeScheduler
from lockstep.server.media.metrics import MediaMetrics
from lockstep.server.media.pipeline.frame import EncodedFrame
from lockstep.server.media.quality.encoding_target import EncodingTarget, PictureTier
from lockstep.server.media.quality.frame_decimator import FrameDecimator
from lockstep.server.media.subscription import Subscription

__all__ = ["KEYFRAME_CAUSES", "TierEncoding"]

KEYFRAME_CAUSES = ("join", "pli", "drop", "tier", "record")


class TierEncoding:
    """One encoding of a stream. Nothing is encoded that nobody needs.

    A target that changes its tier goes on with the old encoding until the new one has a keyframe for it: it misses no
    picture.
    """

    def __init__(
        self,
        stream: str,
        codec: str,
        tier: PictureTier,
        plan: EncodingTarget,
        keyframes: KeyframeScheduler,
        metrics: MediaMetrics,
        *,
        moves_at_keyframes: bool,
    ) -> None:
        """`moves_at_keyframes`: False for sound, see `OwnEncodings.move_all`."""
        self.codec = codec
        self.tier = tier
        self.plan = plan
        self.keyframes = keyframes
        self.cadence = FrameDecimator()
        self.targets: dict[Subscription, None] = {}  # an ordered set
        self.arriving: dict[Subscription, TierEncoding] = {}  # and the encoding that each comes from
        self.recorded = False  # True while a recording takes it
        self.paused_until = 0.0  # no picture before; on the clock of `SourceFrame.arrived_at`
        self.encoded_at = 0.0  # time of the last picture taken, on the same clock
        self._last_capture_time = 0.0
        self._moves_at_keyframes = moves_at_keyframes
        self._encoded = metrics.encoded.labels(stream, codec)
        self._of_tier = metrics.tier_frames.labels(stream, tier)
        self._keyframes_served = metrics.keyframes.labels(stream, codec)
        self._requests = {cause: metrics.keyframe_requests.labels(stream, cause) for cause in KEYFRAME_CAUSES}
        self.encode_seconds = metrics.encode_seconds.labels(stream, codec)

    @property
    def needed(self) -> bool:
        return bool(self.targets or self.arriving or self.recorded)

    @property
    def held_up(self) -> bool:
        """True while the operator's last picture has not left yet: another would only wait behind it."""
        return any(target.priority and target.paced for target in self.targets)

    def variants(self) -> frozenset[bool]:
        """Return the variants that targets need, without and with the trailer: {False}, {True} or both."""
        return frozenset(target.trailer for targets in (self.targets, self.arriving) for target in targets)

    def join(self, target: Subscription) -> None:
        self.targets[target] = None
        self._ask_for_join("join")

    def expect(self, target: Subscription, source: "TierEncoding") -> None:
        """Move `target` from `source` to this encoding with the next keyframe."""
        self.arriving[target] = source
        self._ask_for_join("tier")

    def arrive(self) -> None:
        """Make targets of the arriving ones: the keyframe that they waited for is about to be published."""
        for target, source in self.arriving.items():
            source.targets.pop(target, None)
            self.targets[target] = None
        self.arriving.clear()

    def leave(self, target: Subscription) -> None:
        self.targets.pop(target, None)
        self.arriving.pop(target, None)

    def _ask_for_join(self, cause: str) -> None:
        self.keyframes.join()
        self._requests[cause].inc()

    def request_keyframe(self, cause: str, *, other: bool = False) -> None:
        """Request a keyframe.

        Args:
            cause: "pli" from the peer, "drop" if it could not keep up, "record" for recording
            other: it is for another than the operator, see `StreamEncodings.is_other`
        """
        self.keyframes.request(other=other)
        self._requests[cause].inc()

    def monotone(self, capture_time: float) -> float:
        """Return `capture_time`, but never a time earlier than the one before."""
        self._last_capture_time = max(self._last_capture_time, capture_time)
        return self._last_capture_time

    def publishing(self, frame: EncodedFrame) -> None:
        """Count a frame that is about to go to the targets, and let those begin with it that wait for a keyframe."""
        self._encoded.inc()
        self._of_tier.inc()
        if frame.keyframe:
            self._keyframes_served.inc()
            if self._moves_at_keyframes and self.arriving:
                self.arrive()
