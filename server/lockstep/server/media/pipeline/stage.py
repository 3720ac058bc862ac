"""The interface of all stages that pictures and sound pass on their way from a source to the peers.

A stage wraps the next one and knows no other: it takes a frame, does its one thing, and passes frames on. The last one
is the fan-out, which hands encoded frames to the peers' subscriptions. `stream.py` composes the stages of a stream.

    camera:      admission → passthrough → (thinning) → encoder worker → recording → fan-out
    microphone:  admission → sound rate limiter       → encoder worker → recording → fan-out

Source frames go as far as the encoder worker, encoded frames go on from there; frames that a camera has encoded become
encoded frames in the passthrough. All stages run on the event loop, and their methods return at once.
"""

from typing import NamedTuple

from lockstep.protocol.messages import Media
from lockstep.server.media.encoding.tier_encoding import TierEncoding
from lockstep.server.media.pipeline.frame import EncodedFrame

__all__ = ["FrameStage", "SourceFrame"]


class SourceFrame(NamedTuple):
    """A picture or a piece of sound, as the source made it, with its event stamp."""

    media: Media
    arrived_at: float  # s, on the monotonic clock
    capture_time: float  # s since 1970


class FrameStage:
    """Passes everything on. Stages override its methods, and call `super()` to pass on."""

    def __init__(self, following: "FrameStage") -> None:
        self.following = following

    def source(self, frame: SourceFrame) -> None:
        """Take a frame of the source."""
        self.following.source(frame)

    def encoded(self, frame: EncodedFrame, encoding: TierEncoding) -> None:
        """Take a frame that belongs to one of the stream's encodings."""
        self.following.encoded(frame, encoding)
