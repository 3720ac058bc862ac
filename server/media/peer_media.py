"""What one peer gets, and how it does."""

import logging
from collections.abc import Callable
from typing import NamedTuple, Protocol

from robot_bridge.protocol.console import Quality, Report, StreamInfo, Tier
from server.media.packet_stream import SenderStats
from server.media.peer_stream import PeerStream
from server.media.quality.peer_quality import PeerQuality
from server.media.stream import Stream

__all__ = ["Delivery", "DeliverySender", "PeerMedia"]

logger = logging.getLogger(__name__)


class DeliverySender(Protocol):
    """What it needs of what sends a stream."""

    @property
    def stats(self) -> SenderStats: ...
    def report(self) -> None: ...
    async def stop(self) -> None: ...


class Delivery(NamedTuple):
    """One stream of one peer, with all that serves it."""

    info: StreamInfo
    stream: Stream  # type: ignore[type-arg]  # the job type does not matter here
    target: PeerStream
    sender: DeliverySender


class PeerMedia:
    """Ends with `close`, or by itself when the peer connection closes."""

    def __init__(
        self, deliveries: list[Delivery], quality: PeerQuality, on_close: Callable[["PeerMedia"], None]
    ) -> None:
        self.quality = quality
        self.voice = ""  # mid of the section in which the peer's own sound is taken; "" when it is not
        self._deliveries = deliveries
        self._on_close = on_close
        self._has_failed = False
        self._tell_failed: Callable[[str, Exception], None] = _log_failure

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

    @property
    def tier(self) -> Tier | None:
        """None: it receives no video."""
        return self.quality.tier if self.quality.cameras else None

    @property
    def loss(self) -> float | None:
        """0 to 1, of pictures on the way to this peer; None before its first report."""
        return self.quality.loss

    @property
    def round_trip_ms(self) -> float | None:
        """Of RTCP; None before the first that was measured."""
        return self.quality.round_trip_ms

    @property
    def queues(self) -> bool:
        """Whether packets waited on the path to this peer within the last minute."""
        return self.quality.path.limited

    def report(self, report: Report, now: float) -> None:
        """Take the client's own report. `now` is on the monotonic clock."""
        self.quality.report(report, now)

    @property
    def comes_first(self) -> bool:
        """Whether it drives, or may, or has many behind it."""
        return self.quality.drives or self.quality.operator or self.quality.relays

    def drives(self, holds_seat: bool) -> None:
        """Whether this peer holds the control seat: the operator's tier is made for who does."""
        self.quality.drives = holds_seat
        for delivery in self._deliveries:
            delivery.target.priority = holds_seat

    def on_quality(self, tell: Callable[[Quality], None]) -> None:
        """Call `tell` when something else was decided for this peer's pictures."""
        self.quality.on_quality = tell

    def on_failed(self, tell: Callable[[str, Exception], None]) -> None:
        """Call `tell` with the stage and what was raised once this peer cannot be served; it raises nothing."""
        self._tell_failed = tell

    def failed(self, stage: str, error: Exception) -> None:
        """Serving this peer raised `error`: it gets nothing more. Only the first is told. Raises nothing."""
        if not self._has_failed:
            self._has_failed = True
            self._leave_all()
            self._tell_failed(stage, error)

    def send_reports(self) -> None:
        """Send a sender report for each stream. Raises nothing."""
        for delivery in self._deliveries:
            try:
                delivery.sender.report()
            except Exception as error:
                self.failed("rtcp", error)

    def detach(self) -> None:
        """Take no more frames. Idempotent; raises nothing."""
        error = self._leave_all()
        if error is not None:
            self.failed("forget", error)

    def _leave_all(self) -> Exception | None:
        """Every stream is left, and the plane knows it, whatever one of them raises."""
        first: Exception | None = None
        for delivery in self._deliveries:
            delivery.target.sender = None
            try:
                delivery.stream.leave(delivery.target)
            except Exception as error:
                first = first or error
        try:
            self._on_close(self)
        except Exception as error:
            first = first or error
        return first

    async def close(self) -> None:
        """Stop sending to this peer. Idempotent; safe before and after the peer connection closes."""
        self.detach()
        for delivery in self._deliveries:
            try:
                await delivery.sender.stop()
            except Exception as error:
                self.failed("close", error)


def _log_failure(stage: str, error: Exception) -> None:
    logger.error("media failed in stage %s", stage, exc_info=error)
