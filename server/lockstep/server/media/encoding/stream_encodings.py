"""The encodings of one stream, and who gets which."""

from collections.abc import Iterator

from lockstep.server.media.encoding.own_encodings import OwnEncodings
from lockstep.server.media.encoding.tier_encoding import TierEncoding
from lockstep.server.media.metrics import MediaMetrics
from lockstep.server.media.quality.encoding_target import EncodingTarget, PictureTier
from lockstep.server.media.settings import MediaSettings
from lockstep.server.media.subscription import Subscription

__all__ = ["PASSED", "SECOND_TIERS", "StreamEncodings"]

SECOND_TIERS: tuple[PictureTier, ...] = ("high", "crowd")  # due more than a narrow operator's pictures
PASSED = "H264-passed"  # the codec in metrics of pictures that are passed on as the camera encoded them


class StreamEncodings:
    """The encodings that the console makes of a stream, and for a camera its own. Iterating yields all of them.

    Attributes:
        codecs: what the console can encode, the best first
        full: the best encoding target that a tier can get
        own: the encodings that the console makes
        passed: the encoding that the camera itself makes; None for a microphone
        second: the second encoding that a robot makes of it for observers; None for a microphone
        passes: True while the camera makes it
        follows: True while the camera makes it as it is asked to, with keyframes on request: a robot that encodes
    """

    def __init__(
        self,
        stream: str,
        codecs: tuple[str, ...],
        full: EncodingTarget,
        settings: MediaSettings,
        metrics: MediaMetrics,
        *,
        video: bool,
    ) -> None:
        self.stream = stream
        self.codecs = codecs
        self.full = full
        self.own = OwnEncodings(stream, full, settings, metrics, video=video)
        self.passes = False
        self.follows = False
        self._subscriptions: dict[Subscription, None] = {}  # an ordered set
        self._peers = metrics.peers.labels(stream)
        self.passed: TierEncoding | None = None
        self.second: TierEncoding | None = None

    def __iter__(self) -> Iterator[TierEncoding]:
        if self.passed is not None:
            yield self.passed
        if self.second is not None:
            yield self.second
        yield from self.own

    @property
    def is_taken(self) -> bool:
        """True if some peer gets this stream."""
        return bool(self._subscriptions)

    def add_passed(self) -> TierEncoding:
        """Create the encoding of pictures that are passed on as the camera encoded them."""
        self.passed = self.own.create(PASSED, "operator")
        return self.passed

    def add_second(self) -> TierEncoding:
        """Create the encoding of pictures that a robot encodes a second time, for observers."""
        self.second = self.own.create(PASSED, "high")
        return self.second

    def is_passed_to(self, target: Subscription) -> bool:
        """Return whether `target` gets what the camera or its robot encoded."""
        return any(each is not None and target in each.targets for each in (self.passed, self.second))

    def join(self, codec: str, target: Subscription, tier: PictureTier = "operator") -> None:
        target.tier = tier
        self.own.get(codec, tier).join(target)
        self._subscriptions[target] = None
        self._peers.inc()

    def move(self, codec: str, target: Subscription, tier: PictureTier) -> None:
        """Give `target` another tier, from that tier's next keyframe on.

        Does nothing for a target that has left or is in that tier, except to cancel its pending move to another. A
        target that gets the camera's own encoding is in no tier until it gets one of the console's again.
        """
        if target not in self._subscriptions:
            return
        target.tier = tier
        source = next((each for each in self if target in each.targets), None)
        if source is None or source is self.passed:
            return
        if source is self.second:
            if tier not in SECOND_TIERS:
                self.return_to_own(target)
            return
        for each in self.own:
            each.arriving.pop(target, None)
        if source.tier != tier:
            self.own.get(codec, tier).expect(target, source)

    def request_keyframe(self, target: Subscription, cause: str) -> None:
        """Request a keyframe for `target`; see `TierEncoding.request_keyframe`.

        Most cameras take no such requests: instead of their encoding, the target gets the console's.
        """
        for each in self:
            if target in each.targets:
                each.request_keyframe(cause, other=self.is_other(target))
                if each is self.passed and not self.follows:
                    self.return_to_own(target)

    def is_other(self, target: Subscription) -> bool:
        """Return whether a keyframe for `target` has to wait on a full path: the operator takes the stream too."""
        return not target.priority and any(each.priority for each in self._subscriptions)

    def return_to_own(self, target: Subscription) -> None:
        """Move `target` from the camera's encoding to the console's with its next keyframe; it misses nothing."""
        source = self.second if self.second is not None and target in self.second.targets else self.passed
        own = self.own.get("H264", target.tier)
        if source is not None and target not in own.arriving:
            own.expect(target, source)

    def leave(self, target: Subscription) -> None:
        """Remove a target. Idempotent."""
        if target in self._subscriptions:
            del self._subscriptions[target]
            self._peers.dec()
        for each in self:
            each.leave(target)
