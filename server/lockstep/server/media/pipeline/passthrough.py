"""Passes H.264 that a camera has encoded, unchanged, to the peers that can take it. No I/O.

| peer | gets |
|---|---|
| negotiated H.264 of a profile that holds the camera's | the camera's own pictures, from its next keyframe on |
| the same, until that keyframe, and after a lost picture: cameras take no keyframe requests | the console's encoding |
| the same, while its path shows a limit: the camera's pictures cannot be made smaller | the console's encoding |
| VP8, or H.264 of a smaller profile | the console's encoding |
"""

from collections import deque
from collections.abc import Callable, Iterable

from lockstep.protocol.messages import Media
from lockstep.server.media.codecs.h264 import Profile, accepts, inspect
from lockstep.server.media.pipeline.tier_encoding import TierEncoding
from lockstep.server.media.quality.encoding_target import PictureTier
from lockstep.server.media.subscription import Subscription

__all__ = ["PASSED", "Passthrough"]

MEASURED_SECONDS, MOST_MEASURED = 2.0, 240
PASSED = "H264-passed"  # the codec in metrics of pictures passed on unchanged


class Passthrough:
    """The targets of the camera's own pictures. Part of one stream, which reports joins, moves and leaves."""

    def __init__(self, output: TierEncoding, encoded: Callable[[PictureTier], TierEncoding]) -> None:
        """`output`: of the camera's own pictures. `encoded`: returns the console's H.264 encoding of a tier."""
        self.output = output
        self.profile: Profile | None = None  # of the camera's pictures; None while it gives no H.264
        self._encoded = encoded
        self._tiers: dict[Subscription, PictureTier] = {}  # of the console's encoding, for each target
        self._held_back: set[Subscription] = set()
        self._recent: deque[tuple[float, int]] = deque()  # time of capture and bytes

    def holds(self, target: Subscription) -> bool:
        return target in self.output.targets

    def came(self, media: Media) -> None:
        """Measure a picture of the camera."""
        self._recent.append((media.time, len(media.payload)))
        while len(self._recent) > MOST_MEASURED or media.time - self._recent[0][0] > MEASURED_SECONDS:
            self._recent.popleft()

    @property
    def measured(self) -> tuple[float, float]:
        """Pictures and bits per second of the camera, over the last two seconds; 0 while they are not known."""
        span = self._recent[-1][0] - self._recent[0][0] if self._recent else 0.0
        if span <= 0:
            return 0.0, 0.0
        return (len(self._recent) - 1) / span, 8 * sum(size for _, size in self._recent) / span

    def place(self, target: Subscription, tier: PictureTier) -> None:
        """Set the tier in which `target` gets the console's encoding."""
        self._tiers[target] = tier

    def leave(self, target: Subscription) -> None:
        self._tiers.pop(target, None)
        self._held_back.discard(target)

    def hold_back(self, target: Subscription, wanted: bool) -> None:
        """Set whether `target` must get the console's encoding, because its path has no room."""
        if not wanted:
            self._held_back.discard(target)
        elif target not in self._held_back:
            self._held_back.add(target)
            if self.holds(target):
                self.return_to_ours(target)

    def begin(self, keyframe: Media, outputs: Iterable[TierEncoding]) -> None:
        """Take a keyframe of the camera: targets that can decode it move here, those that no longer can move back."""
        access = inspect(keyframe.payload)
        if access.profile is not None:
            self.profile = access.profile
        for target in list(self.output.targets):
            if not self._may(target):
                self.return_to_ours(target)
        for output in outputs:
            for target in [*output.targets, *output.arriving]:
                if self._may(target):
                    output.leave(target)
                    self.output.targets[target] = None

    def end(self) -> None:
        """Move all targets to the console's encoding, from a keyframe on: the camera gives other pictures now."""
        self.profile = None
        for target in list(self.output.targets):
            self.return_to_ours(target)

    def return_to_ours(self, target: Subscription) -> None:
        """Move `target` to the console's encoding with its next keyframe, which comes at once; it misses nothing."""
        self._encoded(self._tiers.get(target, "operator")).expect(target, self.output)

    def _may(self, target: Subscription) -> bool:
        negotiated = target.h264
        if negotiated is None or self.profile is None or target in self._held_back:
            return False
        return accepts(negotiated, self.profile)
