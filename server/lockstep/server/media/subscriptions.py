"""The media streams that one peer receives, and their statistics."""

import logging
from collections.abc import Callable
from typing import NamedTuple

from lockstep.protocol.console import Quality, Report, StreamInfo, Tier
from lockstep.rtc.endpoint import Connection
from lockstep.rtc.rtp.stage import BandwidthEstimate, KeyframeRequested, PacketsLeft, Reception, StreamEvent
from lockstep.server.media.picture_traces import PictureTraces
from lockstep.server.media.pipeline.rtp_sender import SenderStats
from lockstep.server.media.pipeline.stream import Stream
from lockstep.server.media.quality.peer_quality import PeerQuality
from lockstep.server.media.subscription import Subscription
from lockstep.server.webrtc.datagram_queue import DriverQueue

__all__ = ["Delivery", "Subscriptions"]

logger = logging.getLogger(__name__)


class Delivery(NamedTuple):
    """One stream of one peer, with the objects that serve it."""

    info: StreamInfo
    stream: Stream
    target: Subscription


REPORTS_OFTEN = 1 / 3  # s


class Subscriptions:
    """One peer's subscriptions. Its connection calls `connected`, then `heard` for stream events; `close` ends it.

    Attributes:
        traces: of the pictures that are sent to this peer, while it asks for them
    """

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
        """`on_paced` is called when a stream may send more; `turns` is told whether this peer drives."""
        self.quality = quality
        self.voice = ""  # mid of the section that receives the peer's own sound; "" without one
        self.deliveries = deliveries
        self.traces = PictureTraces()
        self._connection = connection
        self._on_close = on_close
        self._on_connected = on_connected
        self._on_paced = on_paced
        self._turns = turns
        self._report_seconds = 1.0  # between two sender reports, unless this peer comes first
        self._has_left = False
        self._failure: tuple[str, Exception] | None = None  # stage and error of the first failure
        self._has_ended = False  # another epoch has begun
        self._tell_failed: Callable[[str, Exception], None] = _log_failure
        self._tell_ended: Callable[[], None] = lambda: None

    @property
    def streams(self) -> list[StreamInfo]:
        """The negotiated streams, in the order of the answer's sections. Inactive sections have none."""
        return [delivery.info for delivery in self.deliveries]

    @property
    def stats(self) -> dict[str, SenderStats]:
        """Counters and the peer's reports, by mid."""
        return {delivery.info.mid: delivery.target.sender.stats for delivery in self.deliveries}

    @property
    def dropped(self) -> int:
        """Frames that this peer did not get because it could not keep up."""
        return sum(delivery.target.dropped for delivery in self.deliveries)

    @property
    def tier(self) -> Tier | None:
        """The peer's tier; None if it receives no video."""
        return self.quality.tier if self.quality.cameras else None

    @property
    def loss(self) -> float | None:
        """The loss of pictures on the path to this peer, 0 to 1; None before its first report."""
        return self.quality.loss

    @property
    def round_trip_ms(self) -> float | None:
        """The RTCP round trip in ms; None before the first measurement."""
        return self.quality.round_trip_ms

    @property
    def queues(self) -> bool:
        """True if packets waited on the path to this peer within the last minute."""
        return self.quality.path.limited

    def report(self, report: Report, now: float) -> None:
        """Take the client's own report. `now` is on the monotonic clock."""
        self.quality.report(report, now)

    def connected(self) -> None:
        """Start sending media: the connection is up."""
        self._set_pace()
        for delivery in () if self._has_left else self.deliveries:
            delivery.target.sends = True
            encoded_as = self.quality.encoded_as if delivery.info.kind == "video" else self.quality.hears_as
            delivery.stream.encodings.join(delivery.info.codec, delivery.target, encoded_as)
        if self.quality.cameras and not self._has_left:
            self._on_connected()

    def heard(self, mid: str, event: StreamEvent) -> None:
        """Handle an event of the stream in section `mid`: the peer's feedback, or packets that left."""
        delivery = next((each for each in self.deliveries if each.info.mid == mid), None)
        if delivery is None or self._has_left:
            return
        if isinstance(event, KeyframeRequested):
            delivery.stream.encodings.request_keyframe(delivery.target, "pli")
        elif isinstance(event, Reception):
            delivery.target.sender.reported(event)
            self.quality.reception(event.lost, event.expected, event.round_trip)
        elif isinstance(event, BandwidthEstimate):
            delivery.target.sender.estimated(event.bitrate)
            self.quality.bandwidth(event.bitrate, event.ssrcs)
        elif isinstance(event, PacketsLeft):
            self._on_paced(delivery.target)

    def drives(self, holds_seat: bool) -> None:
        """Set whether this peer holds the control seat; the operator's tier is planned for the holder."""
        self.quality.drives = holds_seat
        for delivery in self.deliveries:
            delivery.target.priority = holds_seat
        if self._turns is not None:
            self._turns.drives = holds_seat
        self._set_pace()

    def report_every(self, seconds: float) -> None:
        """Send a sender report every `seconds`, unless this peer comes first."""
        if seconds != self._report_seconds:
            self._report_seconds = seconds
            self._set_pace()

    def _set_pace(self) -> None:
        """Set the interval of sender reports and the urgency of this peer's datagrams.

        A round trip shows the queue that the last report met, so a peer on whom the operator's pictures depend gets
        three reports a second: a queue of a few hundred milliseconds has to show before it has grown to a second.
        On the narrowest paths that is a hundredth of the traffic; RTCP may take a twentieth (RFC 4585 3.4).
        """
        quality = self.quality
        comes_first = quality.drives or quality.operator or quality.relays
        self._connection.urgent = quality.drives or quality.operator
        self._connection.peer.media.streams.report_every(REPORTS_OFTEN if comes_first else self._report_seconds)

    def on_quality(self, tell: Callable[[Quality], None]) -> None:
        """Call `tell` whenever the quality of this peer's pictures changes."""
        self.quality.on_quality = tell

    def request_keyframe(self, mid: str) -> None:
        """Request a keyframe for somebody behind this peer who cannot decode."""
        for delivery in self.deliveries:
            if delivery.info.mid == mid:
                delivery.stream.encodings.request_keyframe(delivery.target, "pli")

    def on_failed(self, tell: Callable[[str, Exception], None]) -> None:
        """Call `tell` with the stage and the exception once this peer cannot be served, at once if it is so already;
        `tell` raises nothing."""
        self._tell_failed = tell
        if self._failure is not None:
            tell(*self._failure)

    def on_ended(self, tell: Callable[[], None]) -> None:
        """Call `tell` once the streams have ended, at once if they have; `tell` raises nothing."""
        self._tell_ended = tell
        if self._has_ended:
            tell()

    def failed(self, stage: str, error: Exception) -> None:
        """Stop serving this peer, because doing so raised `error`. Only the first error is told. Raises nothing."""
        if self._failure is None:
            self._failure = stage, error
            self._leave_all()
            self._tell_failed(stage, error)

    def detach(self) -> None:
        """Take no more frames, because the streams have ended. Raises nothing."""
        self._has_ended = True
        self._leave()
        self._tell_ended()

    def _leave(self) -> None:
        error = self._leave_all()
        if error is not None:
            self.failed("forget", error)

    def _leave_all(self) -> Exception | None:
        """Leave every stream and tell the media hub, even if some of that raises; return the first error."""
        self._has_left = True
        first: Exception | None = None
        for delivery in self.deliveries:
            delivery.target.sends = False
            try:
                delivery.stream.encodings.leave(delivery.target)
            except Exception as error:
                first = first or error
        try:
            self._on_close(self)
        except Exception as error:
            first = first or error
        return first

    async def close(self) -> None:
        """Stop sending to this peer. Idempotent; does not close its connection."""
        self._leave()


def _log_failure(stage: str, error: Exception) -> None:
    logger.error("media failed in stage %s", stage, exc_info=error)
