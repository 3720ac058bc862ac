"""The media streams that one peer receives, and their statistics."""

from collections.abc import Callable
from typing import NamedTuple

from lockstep.protocol.console import Quality, Report, StreamInfo, Tier
from lockstep.rtc.rtp.stage import BandwidthEstimate, KeyframeRequested, PacketsLeft, Reception, StreamEvent
from lockstep.server.media.picture_traces import PictureTraces
from lockstep.server.media.pipeline.stream import Stream
from lockstep.server.media.quality.peer_quality import PeerQuality
from lockstep.server.media.sending_priority import SendingPriority
from lockstep.server.media.stream_ending import StreamEnding
from lockstep.server.media.subscription import Subscription

__all__ = ["Delivery", "Subscriptions"]


class Delivery(NamedTuple):
    """One stream of one peer, with the objects that serve it."""

    info: StreamInfo
    stream: Stream
    target: Subscription


class Subscriptions:
    """One peer's subscriptions. Its connection calls `connected`, then `heard` for stream events; `close` ends it.

    Attributes:
        traces: of the pictures that are sent to this peer, while it asks for them
        ending: tells of a failure, and of the end of the streams
    """

    def __init__(
        self,
        deliveries: list[Delivery],
        quality: PeerQuality,
        priority: SendingPriority,
        *,
        on_close: Callable[["Subscriptions"], None],
        on_connected: Callable[[], None] = lambda: None,
        on_paced: Callable[[Subscription], None] = lambda target: None,
    ) -> None:
        """`on_paced` is called when a stream may send more."""
        self.quality = quality
        self.priority = priority
        self.ending = StreamEnding()
        self.voice = ""  # mid of the section that receives the peer's own sound; "" without one
        self.deliveries = deliveries
        self.traces = PictureTraces()
        self._on_close = on_close
        self._on_connected = on_connected
        self._on_paced = on_paced
        self._has_left = False

    @property
    def streams(self) -> list[StreamInfo]:
        """The negotiated streams, in the order of the answer's sections. Inactive sections have none."""
        return [delivery.info for delivery in self.deliveries]

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
        self.priority.apply()
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
        self.priority.apply()

    def on_quality(self, tell: Callable[[Quality], None]) -> None:
        """Call `tell` whenever the quality of this peer's pictures changes."""
        self.quality.on_quality = tell

    def on_failed(self, tell: Callable[[str, Exception], None]) -> None:
        """Call `tell` with the stage and the exception once this peer cannot be served; see `StreamEnding`."""
        self.ending.on_failed(tell)

    def failed(self, stage: str, error: Exception) -> None:
        """Stop serving this peer, because doing so raised `error`. Only the first error is told. Raises nothing."""
        if self.ending.failure is None and not self._has_left:
            self.leave((stage, error))

    def leave(self, failure: tuple[str, Exception] | None = None) -> None:
        """Leave every stream and tell the media hub, even if some of that raises; then tell of the first error.

        `failure`: stage and error that are the reason. Idempotent; raises nothing.
        """
        self._has_left = True
        for delivery in self.deliveries:
            delivery.target.sends = False
            try:
                delivery.stream.encodings.leave(delivery.target)
            except Exception as error:
                failure = failure or ("forget", error)
        try:
            self._on_close(self)
        except Exception as error:
            failure = failure or ("forget", error)
        if failure is not None:
            self.ending.fail(*failure)

    async def close(self) -> None:
        """Stop sending to this peer. Idempotent; does not close its connection."""
        self.leave()
