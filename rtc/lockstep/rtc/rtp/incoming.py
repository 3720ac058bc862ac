"""One stream that the peer sends: the chain of its stages, made when its first packet shows its SSRC."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from lockstep.rtc.rtp.feedback import PictureLoss, Remb
from lockstep.rtc.rtp.losses import Losses
from lockstep.rtc.rtp.receiver_reports import ReceiverReports
from lockstep.rtc.rtp.repairs import Repairs
from lockstep.rtc.rtp.stage import RoundTrip, Sink, StreamEvent
from lockstep.rtc.rtp.wire.extensions import ExtensionReader
from lockstep.rtc.rtp.wire.packet import RtpPacket
from lockstep.rtc.rtp.wire.rtcp import ReceiverReport, RtcpPacket

__all__ = ["IncomingParameters", "IncomingStream"]

KEYFRAME_INTERVAL = 0.5  # s between two requests: a keyframe that is on its way would only be made twice


@dataclass(frozen=True, slots=True)
class IncomingParameters:
    """The parameters that were negotiated for one section."""

    own_ssrc: int  # of the reports of this side
    clock_rates: Mapping[int, int]  # Hz, by payload type
    extension_ids: Mapping[str, int] = field(default_factory=dict)  # by URI
    repair_types: Mapping[int, int] = field(default_factory=dict)  # payload type of a retransmission → of the original
    asks_again: bool = True  # True if the peer keeps packets (a=rtcp-fb: nack)


class _Chain:
    def __init__(self, parameters: IncomingParameters, packet: RtpPacket, round_trip: RoundTrip, sink: Sink) -> None:
        self.ssrc, own = packet.ssrc, parameters.own_ssrc
        clock_rate = parameters.clock_rates[packet.payload_type]
        self.losses = Losses(sink, own, self.ssrc, round_trip) if parameters.asks_again else None
        self.repairs = Repairs(self.losses or sink, self.ssrc, parameters.repair_types)
        self.reports = ReceiverReports(self.repairs, own, self.ssrc, clock_rate)
        self.first = ExtensionReader(self.reports, parameters.extension_ids)


class IncomingStream:
    """One stream from the peer. `ignored` counts packets that belong to nothing: retransmissions of an unknown stream,
    unknown payload types."""

    def __init__(self, parameters: IncomingParameters, round_trip: RoundTrip) -> None:
        self.ignored = 0
        self.limit: int | None = None  # bit/s that the peer is asked not to exceed, with each report; None: it is not
        self._parameters = parameters
        self._round_trip = round_trip
        self._sink = Sink()
        self._chain: _Chain | None = None
        self._asked_at = float("-inf")  # the time of the last request for a keyframe

    @property
    def ssrc(self) -> int | None:
        """The SSRC of the stream; None before the first packet."""
        return None if self._chain is None else self._chain.ssrc

    @property
    def reports(self) -> ReceiverReports | None:
        """The stage that reports; None before the first packet."""
        return None if self._chain is None else self._chain.reports

    def rtp(self, packet: RtpPacket, now: float) -> None:
        """Take a decrypted packet of this section."""
        is_repair = packet.payload_type in self._parameters.repair_types
        if not is_repair and packet.payload_type not in self._parameters.clock_rates:
            self.ignored += 1
            return
        if not is_repair and packet.ssrc != self.ssrc:  # the first, or the peer began anew (RFC 3550 8.2)
            self._chain = _Chain(self._parameters, packet, self._round_trip, self._sink)
        if self._chain is None:
            self.ignored += 1
            return
        self._chain.first.rtp(packet, now)

    def rtcp(self, packet: RtcpPacket, now: float) -> None:
        if self._chain is not None:
            self._chain.first.rtcp(packet, now)

    def request_keyframe(self, now: float) -> None:
        """Ask for a keyframe, unless that was done just now. No effect before the first packet shows the stream."""
        if self.ssrc is not None and now - self._asked_at >= KEYFRAME_INTERVAL:
            self._asked_at = now
            self._sink.control(PictureLoss(self._parameters.own_ssrc, self.ssrc), now)

    def timer(self) -> float | None:
        return None if self._chain is None else self._chain.first.timer()

    def handle_timer(self, now: float) -> None:
        if self._chain is not None:
            self._chain.first.handle_timer(now)

    def packets(self) -> list[RtpPacket]:
        """Return the packets for the application, as they came: nothing is held back or put in order."""
        return self._sink.drain_packets()

    def controls_to_send(self) -> list[RtcpPacket]:
        controls = self._sink.drain_controls()
        if self.limit is not None and self.ssrc is not None and any(isinstance(x, ReceiverReport) for x in controls):
            controls.append(Remb(self._parameters.own_ssrc, self.limit, (self.ssrc,)))
        return controls

    def events(self) -> list[StreamEvent]:
        return self._sink.drain_events()
