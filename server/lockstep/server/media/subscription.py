"""The delivery of one stream to one peer."""

import time
from collections.abc import Callable

from lockstep.protocol.carriers import Carrier
from lockstep.protocol.serial import event_gap
from lockstep.server.media.codecs.h264 import Profile
from lockstep.server.media.encoding.frame_queue import FrameQueue
from lockstep.server.media.metrics import MediaMetrics
from lockstep.server.media.picture_traces import SentPictures
from lockstep.server.media.pipeline.frame import EncodedFrame
from lockstep.server.media.pipeline.rtp_sender import RtpSender
from lockstep.server.media.quality.encoding_target import PictureTier

__all__ = ["Subscription"]


class Subscription:
    """A fan-out target: a queue in front of a sender."""

    def __init__(
        self,
        queue: FrameQueue,
        sender: RtpSender,
        *,
        priority: bool,
        stream: str,
        carrier: Carrier,
        metrics: MediaMetrics,
        on_dropped: Callable[[], None],
        on_failed: Callable[[Exception], None],
    ) -> None:
        """`on_failed` gets the exception that serving this stream raised, and raises nothing itself."""
        self.priority = priority
        self.trailer = carrier == "trailer"
        self.h264: Profile | None = None  # negotiated profile; None for another codec
        self.tier: PictureTier = "operator"  # of the console's encoding that it gets, or would get
        self.held_back = False  # from the camera's own encoding, because its path has no room
        self.last_stamp: int | None = None  # event of the frame that it got last; None before the first
        self.sends = False  # True from the connection's begin to the peer's end
        self.sender = sender
        self.traced = SentPictures(stream)
        self._queue = queue
        self._on_dropped = on_dropped
        self._on_failed = on_failed
        self._dropped = metrics.dropped.labels(stream, "peer_busy")
        self._packets = metrics.packets.labels(stream, carrier)
        self._octets = metrics.octets.labels(stream, carrier)

    @property
    def dropped(self) -> int:
        """Frames that this peer did not get because it could not keep up."""
        return self._queue.dropped

    @property
    def paced(self) -> bool:
        """True while part of the last frame has not left yet."""
        return self.sends and self.sender.paced

    def is_ahead_of(self, stamp: int) -> bool:
        """Return whether the last frame is of a later event than this: events never go back."""
        return self.last_stamp is not None and event_gap(self.last_stamp, stamp) > 0

    def put(self, frame: EncodedFrame) -> None:
        self.last_stamp = frame.stamp
        before = self._queue.dropped
        complete = self._queue.put(frame)
        if self._queue.dropped != before:
            self._dropped.inc(self._queue.dropped - before)
        if not complete:
            self._on_dropped()

    def send_next(self) -> bool:
        sender = self.sender
        if not self.sends or sender.paced:
            return False
        frame = self._queue.peek()
        if frame is None:
            return False
        sent = sender.transmit(frame)
        if sent is None:
            return False
        self._queue.pop()
        if self.traced.wanted:
            self.traced.sent(frame, sender.rtp_time, time.monotonic())
        self._count(*sent)
        return self._queue.peek() is not None and not sender.paced

    def failed(self, error: Exception) -> None:
        self.sends = False
        self._on_failed(error)

    def _count(self, packets: int, octets: int) -> None:
        self._packets.inc(packets)
        self._octets.inc(octets)
