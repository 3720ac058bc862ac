"""The stage that bounds how much sound may come: each packet made of it costs the loop."""

from lockstep.protocol.messages import Media
from lockstep.server.media.codecs.opus_packet import OPUS_RATE, opus_samples
from lockstep.server.media.errors import PayloadError
from lockstep.server.media.metrics import DropCounter
from lockstep.server.media.pipeline.stage import FrameStage, SourceFrame

__all__ = ["SoundRateLimiter"]

MIN_RATE = 8_000  # Hz, assumed for sound that claims less
LEAST_OPUS_SECONDS = 0.02  # that a packet counts; shorter ones may come as rarely
MAX_AHEAD = 2.0  # s of sound that may come at once
FASTEST = 1.25  # s of sound in a second, afterwards


class SoundRateLimiter(FrameStage):
    """Drops sound of which more comes than time passes, and what is no Opus packet."""

    def __init__(self, following: FrameStage, dropped: DropCounter) -> None:
        super().__init__(following)
        self._dropped = dropped
        self._room = MAX_AHEAD  # s of sound that may come now
        self._came_at = 0.0  # arrival of the last sound

    def source(self, frame: SourceFrame) -> None:
        media = frame.media
        self._room = min(MAX_AHEAD, self._room + max(0.0, frame.arrived_at - self._came_at) * FASTEST)
        self._came_at = frame.arrived_at
        try:
            seconds = _seconds(media)
        except PayloadError as error:
            self._dropped.count(error.name)
            return
        if seconds > self._room:
            self._dropped.count("too_often")
            return
        self._room -= seconds
        super().source(frame)


def _seconds(media: Media) -> float:
    if media.codec == "opus":
        return max(LEAST_OPUS_SECONDS, opus_samples(media.payload) / OPUS_RATE)
    return len(media.payload) / (2 * max(1, media.channels) * max(MIN_RATE, media.sample_rate))
