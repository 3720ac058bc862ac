"""One codec of one stream: who gets it, and when it needs a keyframe."""

from server.media.frame import EncodedFrame
from server.media.keyframes import KeyframeScheduler
from server.media.metrics import MediaMetrics
from server.media.peer_stream import PeerStream

__all__ = ["Output"]


class Output:
    """Nothing is encoded for an output without targets."""

    def __init__(self, stream: str, codec: str, keyframes: KeyframeScheduler, metrics: MediaMetrics) -> None:
        self.codec = codec
        self.keyframes = keyframes
        self.targets: dict[PeerStream, None] = {}  # an ordered set
        self._last_capture_time = 0.0
        self._encoded = metrics.encoded.labels(stream, codec)
        self._keyframes_served = metrics.keyframes.labels(stream, codec)
        self._requests = {cause: metrics.keyframe_requests.labels(stream, cause) for cause in ("join", "pli", "drop")}
        self.encode_seconds = metrics.encode_seconds.labels(stream, codec)

    def variants(self) -> frozenset[bool]:
        """Whether targets need the trailer: {False}, {True} or both."""
        return frozenset(target.trailer for target in self.targets)

    def join(self, target: PeerStream) -> None:
        self.targets[target] = None
        self.keyframes.join()
        self._requests["join"].inc()

    def leave(self, target: PeerStream) -> None:
        self.targets.pop(target, None)

    def request_keyframe(self, cause: str) -> None:
        """`cause`: "pli" when the peer asks, "drop" when it could not keep up."""
        self.keyframes.request()
        self._requests[cause].inc()

    def monotone(self, capture_time: float) -> float:
        """`capture_time`, never earlier than the one before."""
        self._last_capture_time = max(self._last_capture_time, capture_time)
        return self._last_capture_time

    def count(self, frame: EncodedFrame) -> None:
        self._encoded.inc()
        if frame.keyframe:
            self._keyframes_served.inc()
