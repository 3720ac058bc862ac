"""What one peer gets, and how it does."""

import logging
from collections.abc import Callable
from typing import NamedTuple

from lockstep.protocol.console import Quality, Report, StreamInfo, Tier
from lockstep.rtc.endpoint import Connection
from lockstep.rtc.rtp.stage import BandwidthEstimate, KeyframeRequested, PacketsLeft, Reception, StreamEvent
from lockstep.server.media.pipeline.rtp_sender import RtpSender, SenderStats
from lockstep.server.media.pipeline.stream import Stream
from lockstep.server.media.quality.peer_quality import PeerQuality
from lockstep.server.media.subscription import Subscription
from lockstep.server.webrtc.datagram_queue import DriverQueue

__all__ = ["Delivery", "Subscriptions"]

logger = logging.getLogger(__name__)


class Delivery(NamedTuple):
    """One stream of one peer, with all that serves it."""

    info: StreamInfo
    stream: Stream  # type: ignore[type-arg]  # the job type does not matter here
    target: Subscription
    sender: RtpSender


REPORTS_OFTEN = 1 / 3  # s


class Subscriptions:
    """Its connection tells it `connected`, and `heard` what is about a stream. It ends with `close`."""

    def __init__(
        self,
        connection: Connection,
        deliveries: list[Delivery],
        quality: PeerQuality,
        *,
        on_close: Callable[["Subscriptions"], None],
        on_connected: Callable[[], None] = lambda: None,
        on_paced: Callable[[Subscription], None] = lambda target: None,
        turns: DriverQueue | None = None,
    ) -> None:
        """`on_paced` hears that a stream may send more; `turns` are told whether this peer drives."""
        self.quality = quality
        self.voice = ""  # mid of the section in which the peer's own sound is taken; "" when it is not
        self.deliveries = deliveries
        self._connection = connection
        self._on_close = on_close
        self._on_connected = on_connected
        self._on_paced = on_paced
        self._turns = turns
        self._report_seconds = 1.0  # between two sender reports, unless it comes first
        self._has_left = False
        self._has_failed = False
        self._tell_failed: Callable[[str, Exception], None] = _log_failure

    @property
    def streams(self) -> list[StreamInfo]:
        """The negotiated streams, in the order of the answer's sections. Inactive sections have none."""
        return [delivery.info for delivery in self.deliveries]

    @property
    def stats(self) -> dict[str, SenderStats]:
        """Counters and the peer's reports, by mid."""
        return {delivery.info.mid: delivery.sender.stats for delivery in self.deliveries}

    @property
    def dropped(self) -> int:
        """Frames that this peer did not get because it could not keep up."""
        return sum(delivery.target.dropped for delivery in self.deliveries)

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

    def connected(self) -> None:
        """The connection is up: media flow from now on."""
        self._set_pace()
        for delivery in () if self._has_left else self.deliveries:
            delivery.target.sender = delivery.sender
            encoded_as = self.quality.encoded_as if delivery.info.kind == "video" else self.quality.hears_as
            delivery.stream.join(delivery.info.codec, delivery.target, encoded_as)
        if self.quality.cameras and not self._has_left:
            self._on_connected()

    def heard(self, mid: str, event: StreamEvent) -> None:
        """What the peer says about the stream in section `mid`, or what became of it."""
        delivery = next((each for each in self.deliveries if each.info.mid == mid), None)
        if delivery is None or self._has_left:
            return
        if isinstance(event, KeyframeRequested):
            delivery.stream.request_keyframe(delivery.info.codec, delivery.target, "pli")
        elif isinstance(event, Reception):
            delivery.sender.reported(event)
            self.quality.reception(event.lost, event.expected, event.round_trip)
        elif isinstance(event, BandwidthEstimate):
            delivery.sender.estimated(event.bitrate)
            self.quality.bandwidth(event.bitrate, event.ssrcs)
        elif isinstance(event, PacketsLeft):
            self._on_paced(delivery.target)

    def drives(self, holds_seat: bool) -> None:
        """Whether this peer holds the control seat: the operator's tier is made for who does."""
        self.quality.drives = holds_seat
        for delivery in self.deliveries:
            delivery.target.priority = holds_seat
        if self._turns is not None:
            self._turns.drives = holds_seat
        self._set_pace()

    def report_every(self, seconds: float) -> None:
        """Send sender reports as often, unless this peer comes first."""
        if seconds != self._report_seconds:
            self._report_seconds = seconds
            self._set_pace()

    def _set_pace(self) -> None:
        """How often reports go out, and which peers' datagrams leave first.

        A round trip tells of the queue that the last report met, so a peer on whom the operator's pictures depend gets
        three reports a second: a queue of a few hundred milliseconds is to be seen before it has grown to a second.
        Over the narrowest paths that is a hundredth of what passes; RTCP may take a twentieth (RFC 4585 3.4).
        """
        quality = self.quality
        comes_first = quality.drives or quality.operator or quality.relays
        self._connection.urgent = quality.drives or quality.operator
        self._connection.peer.report_every(REPORTS_OFTEN if comes_first else self._report_seconds)

    def on_quality(self, tell: Callable[[Quality], None]) -> None:
        """Call `tell` when something else was decided for this peer's pictures."""
        self.quality.on_quality = tell

    def request_keyframe(self, mid: str) -> None:
        """Somebody behind this peer cannot decode."""
        for delivery in self.deliveries:
            if delivery.info.mid == mid:
                delivery.stream.request_keyframe(delivery.info.codec, delivery.target, "pli")

    def on_failed(self, tell: Callable[[str, Exception], None]) -> None:
        """Call `tell` with the stage and what was raised once this peer cannot be served; it raises nothing."""
        self._tell_failed = tell

    def failed(self, stage: str, error: Exception) -> None:
        """Serving this peer raised `error`: it gets nothing more. Only the first is told. Raises nothing."""
        if not self._has_failed:
            self._has_failed = True
            self._leave_all()
            self._tell_failed(stage, error)

    def detach(self) -> None:
        """Take no more frames. Idempotent; raises nothing."""
        error = self._leave_all()
        if error is not None:
            self.failed("forget", error)

    def _leave_all(self) -> Exception | None:
        """Every stream is left, and the plane knows it, whatever one of them raises."""
        self._has_left = True
        first: Exception | None = None
        for delivery in self.deliveries:
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
        """Stop sending to this peer. Idempotent; its connection is somebody else's to close."""
        self.detach()


def _log_failure(stage: str, error: Exception) -> None:
    logger.error("media failed in stage %s", stage, exc_info=error)
