"""One stream on its way to one peer."""

from collections.abc import Callable
from typing import Protocol

from robot_bridge.protocol.carriers import Carrier
from server.media.frame import EncodedFrame
from server.media.metrics import MediaMetrics
from server.media.outbox import Outbox

__all__ = ["FrameSender", "PeerStream"]


class FrameSender(Protocol):
    """What sends frames over RTP."""

    def transmit(self, frame: EncodedFrame) -> tuple[int, int] | None:
        """Send a frame: packets and bytes handed to the network. None, and nothing sent, while the socket is full."""


class PeerStream:
    """A fan-out target: an outbox in front of a sender."""

    def __init__(
        self,
        outbox: Outbox,
        *,
        priority: bool,
        stream: str,
        carrier: Carrier,
        metrics: MediaMetrics,
        on_dropped: Callable[[], None],
    ) -> None:
        self.priority = priority
        self.trailer = carrier == "trailer"
        self.sender: FrameSender | None = None  # None before the transport is connected
        self._outbox = outbox
        self._on_dropped = on_dropped
        self._dropped = metrics.dropped.labels(stream, "peer_busy")
        self._packets = metrics.packets.labels(stream, carrier)
        self._octets = metrics.octets.labels(stream, carrier)

    @property
    def dropped(self) -> int:
        """Frames that this peer did not get because it could not keep up."""
        return self._outbox.dropped

    def put(self, frame: EncodedFrame) -> None:
        before = self._outbox.dropped
        complete = self._outbox.put(frame)
        if self._outbox.dropped != before:
            self._dropped.inc(self._outbox.dropped - before)
        if not complete:
            self._on_dropped()

    def send_next(self) -> bool:
        frame = self._outbox.peek()
        if frame is None or self.sender is None:
            return False
        sent = self.sender.transmit(frame)
        if sent is None:
            return False
        self._outbox.pop()
        self._packets.inc(sent[0])
        self._octets.inc(sent[1])
        return self._outbox.peek() is not None
