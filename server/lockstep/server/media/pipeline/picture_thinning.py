"""The stage that thins a camera's pictures to a frame rate, before any tier does."""

from lockstep.server.media.metrics import DropCounter
from lockstep.server.media.pipeline.frame_rate_limiter import FrameRateLimiter
from lockstep.server.media.pipeline.stage import FrameStage, SourceFrame

__all__ = ["PictureThinning"]


class PictureThinning(FrameStage):
    """Passes the pictures on that a `FrameRateLimiter` admits."""

    def __init__(self, following: FrameStage, frames_per_second: float, dropped: DropCounter) -> None:
        super().__init__(following)
        self._limiter = FrameRateLimiter(frames_per_second)
        self._dropped = dropped

    def source(self, frame: SourceFrame) -> None:
        if self._limiter.admit(frame.media.time):
            super().source(frame)
        else:
            self._dropped.count("thinned")
