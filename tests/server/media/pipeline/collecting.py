"""The end of a chain of stages, for tests of one of them; and what it needs around it."""

from typing import Any, cast

from prometheus_client import CollectorRegistry

from lockstep.protocol.messages import Media
from lockstep.server.media.encoding.frame_queue import FrameQueue
from lockstep.server.media.encoding.stream_encodings import StreamEncodings
from lockstep.server.media.encoding.tier_encoding import TierEncoding
from lockstep.server.media.metrics import DropCounter, MediaMetrics
from lockstep.server.media.pipeline.frame import EncodedFrame
from lockstep.server.media.pipeline.rtp_sender import RtpSender
from lockstep.server.media.pipeline.stage import FrameStage, SourceFrame
from lockstep.server.media.quality.encoding_target import EncodingTarget
from lockstep.server.media.settings import MediaSettings
from lockstep.server.media.subscription import Subscription


class Collector(FrameStage):
    """Keeps what comes to the end of the chain."""

    def __init__(self) -> None:
        self.sources: list[SourceFrame] = []
        self.frames: list[tuple[EncodedFrame, TierEncoding]] = []

    def source(self, frame: SourceFrame) -> None:
        self.sources.append(frame)

    def encoded(self, frame: EncodedFrame, encoding: TierEncoding) -> None:
        encoding.publishing(frame)
        self.frames.append((frame, encoding))

    @property
    def stamps(self) -> list[int]:
        return [frame.media.stamp for frame in self.sources]


class Counted:
    """The metrics of a stream "camera0"."""

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        self.metrics = MediaMetrics(self.registry)
        self.dropped = DropCounter(self.metrics, "camera0")

    def drops(self, stage: str) -> float:
        labels = {"stream": "camera0", "stage": stage}
        return self.registry.get_sample_value("lockstep_media_frames_dropped_total", labels) or 0.0

    def encodings(self, *codecs: str, video: bool = True) -> StreamEncodings:
        full = EncodingTarget(800_000, 30.0)
        return StreamEncodings("camera0", codecs, full, MediaSettings(), self.metrics, video=video)

    def subscription(self, **changes: Any) -> Subscription:
        fields: dict[str, Any] = {"priority": False, "stream": "camera0", "carrier": "none", "metrics": self.metrics}
        sender = cast(RtpSender, None)  # these tests send nothing
        return Subscription(
            FrameQueue(6, video=True),
            sender,
            on_dropped=lambda: None,
            on_failed=lambda error: None,
            **{**fields, **changes},
        )


def arrive(stage: FrameStage, *media: Media) -> None:
    """Give a stage these media, each at the time of its capture."""
    for medium in media:
        stage.source(SourceFrame(medium, medium.time, 1000 + medium.time))
