"""What one peer gets, and how it does."""

from collections.abc import Callable
from typing import NamedTuple

from robot_bridge.protocol.console import StreamInfo
from server.media.aiortc_private import MediaSender
from server.media.packet_stream import SenderStats
from server.media.peer_stream import PeerStream
from server.media.stream import Stream

__all__ = ["Delivery", "PeerMedia"]


class Delivery(NamedTuple):
    """One stream of one peer, with all that serves it."""

    info: StreamInfo
    stream: Stream  # type: ignore[type-arg]  # the job type does not matter here
    target: PeerStream
    sender: MediaSender


class PeerMedia:
    """Ends with `close`, or by itself when the peer connection closes."""

    def __init__(self, deliveries: list[Delivery], on_close: Callable[["PeerMedia"], None]) -> None:
        self._deliveries = deliveries
        self._on_close = on_close

    @property
    def streams(self) -> list[StreamInfo]:
        """The negotiated streams, in the order of the answer's sections. Inactive sections have none."""
        return [delivery.info for delivery in self._deliveries]

    @property
    def stats(self) -> dict[str, SenderStats]:
        """Counters and the peer's reports, by mid."""
        return {delivery.info.mid: delivery.sender.stats for delivery in self._deliveries}

    @property
    def dropped(self) -> int:
        """Frames that this peer did not get because it could not keep up."""
        return sum(delivery.target.dropped for delivery in self._deliveries)

    def report(self) -> None:
        """Send a sender report for each stream."""
        for delivery in self._deliveries:
            delivery.sender.report()

    def detach(self) -> None:
        """Take no more frames. Idempotent."""
        for delivery in self._deliveries:
            delivery.stream.leave(delivery.info.codec, delivery.target)
            delivery.target.sender = None
        self._on_close(self)

    async def close(self) -> None:
        """Stop sending to this peer. Idempotent; safe before and after the peer connection closes."""
        self.detach()
        for delivery in self._deliveries:
            await delivery.sender.stop()
