"""Which pictures were sent to one peer, and when: only while that peer asks for traces. No I/O, no clock."""

from collections import deque
from collections.abc import Sequence

from lockstep.protocol.traces.trace_messages import MAX_TRACED_PICTURES, PictureTrace
from lockstep.server.media.pipeline.frame import EncodedFrame

__all__ = ["PictureTraces", "SentPictures"]

NEWEST = 8  # pictures of one stream that are kept until they are taken


class SentPictures:
    """The newest pictures of one stream that left for one peer."""

    def __init__(self, stream: str) -> None:
        self.stream = stream
        self.wanted = False  # while it is False, `sent` must not be called: it costs nothing then
        self._sent: deque[tuple[EncodedFrame, int, float]] = deque(maxlen=NEWEST)

    def sent(self, frame: EncodedFrame, rtp_time: int, now: float) -> None:
        """A picture was handed to the network at `now`, s on the monotonic clock."""
        self._sent.append((frame, rtp_time, now))

    def want(self, wanted: bool) -> None:
        self.wanted = wanted
        self._sent.clear()

    def take(self, most: int) -> list[PictureTrace]:
        """Return the newest, `most` of them, oldest first, and forget all."""
        found = [
            PictureTrace(stream=self.stream, stamp=frame.stamp, rtp_time=rtp_time, spans=frame.timing.spans(at))
            for frame, rtp_time, at in list(self._sent)[-most:]
            if frame.timing is not None
        ]
        self._sent.clear()
        return found


class PictureTraces:
    """All camera streams of one peer."""

    def __init__(self, streams: Sequence[SentPictures] = ()) -> None:
        """`streams` may grow afterwards."""
        self._streams = streams

    def want(self, wanted: bool) -> None:
        """Begin or end keeping what is sent."""
        for each in self._streams:
            each.want(wanted)

    def take(self, most: int) -> list[PictureTrace]:
        """Return what was sent since the last call: of each stream the newest, `most` of them."""
        found = [trace for each in self._streams for trace in each.take(most)]
        return found[:MAX_TRACED_PICTURES]
