"""The encodings of one stream that the console makes."""

from collections.abc import Iterator

from lockstep.server.media.encoding.keyframes import KeyframeScheduler
from lockstep.server.media.encoding.tier_encoding import TierEncoding
from lockstep.server.media.metrics import MediaMetrics
from lockstep.server.media.quality.encoding_target import EncodingTarget, PictureTier
from lockstep.server.media.settings import MediaSettings

__all__ = ["OwnEncodings"]


class OwnEncodings:
    """One encoding for each codec and tier that somebody has asked for. Iterating yields them."""

    def __init__(
        self, stream: str, full: EncodingTarget, settings: MediaSettings, metrics: MediaMetrics, *, video: bool
    ) -> None:
        """`full`: the plan that an encoding begins with."""
        self._stream = stream
        self._full = full
        self._settings = settings
        self._metrics = metrics
        self._video = video
        self._made: dict[tuple[str, PictureTier], TierEncoding] = {}

    def __iter__(self) -> Iterator[TierEncoding]:
        return iter(self._made.values())

    def find(self, codec: str, tier: PictureTier) -> TierEncoding | None:
        """Return an encoding if it exists."""
        return self._made.get((codec, tier))

    def get(self, codec: str, tier: PictureTier) -> TierEncoding:
        """Return an encoding, created by the first call; it costs nothing while nobody needs it."""
        found = self._made.get((codec, tier))
        if found is None:
            found = self._made[codec, tier] = self.create(codec, tier)
        return found

    def create(self, codec: str, tier: PictureTier) -> TierEncoding:
        """Return an encoding of this stream that is not one of these: the console does not make it."""
        settings = self._settings
        keyframes = KeyframeScheduler(settings.keyframe_interval_seconds, settings.keyframe_spacing_seconds)
        return TierEncoding(
            self._stream, codec, tier, self._full, keyframes, self._metrics, moves_at_keyframes=self._video
        )

    def of_tier(self, tier: PictureTier) -> list[TierEncoding]:
        """Return the existing encodings for a tier, in all codecs."""
        return [each for each in self if each.tier == tier]

    def move_all(self, codec: str) -> None:
        """Complete the pending moves between the encodings of a codec."""
        for each in self:
            if each.codec == codec:
                each.arrive()
