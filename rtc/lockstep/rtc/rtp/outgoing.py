"""One outgoing stream: its numbers, and the chain of its stages."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from lockstep.rtc.rtp.history import History, RepairStream
from lockstep.rtc.rtp.pacer import Pacer, PathBudget
from lockstep.rtc.rtp.requests import Requests
from lockstep.rtc.rtp.sender_reports import SenderReports
from lockstep.rtc.rtp.stage import RoundTrip, Sink, Stage, StreamEvent
from lockstep.rtc.rtp.wire.extensions import ExtensionWriter, TransportNumbers
from lockstep.rtc.rtp.wire.packet import RtpPacket
from lockstep.rtc.rtp.wire.rtcp import RtcpPacket

__all__ = ["MAX_PAYLOAD", "OutgoingParameters", "OutgoingStream", "PathShare"]

MAX_PAYLOAD = 1200  # bytes; headers and encryption add some sixty, and paths carry 1,400


@dataclass(frozen=True, slots=True)
class OutgoingParameters:
    """The parameters that were negotiated or drawn for one stream."""

    ssrc: int
    payload_type: int
    clock_rate: int  # Hz
    cname: str
    # RFC 3550 5.1: both random. In the lower half, the first wrap is away from the start (RFC 3711 3.3.1: how often
    # they wrapped is not in the packets).
    first_sequence_number: int
    timestamp_offset: int
    extension_ids: Mapping[str, int] = field(default_factory=dict)  # by URI
    fixed_values: Mapping[str, bytes] = field(default_factory=dict)  # of extensions in every packet, by URI
    repair: RepairStream | None = None  # None: RFC 4588 is not in use
    repeats: bool = True  # True: the peer may ask for packets again; False: nothing is kept


@dataclass(slots=True)
class PathShare:
    """The state that the streams to one peer share. An application may have it measure round trips and limit the path's
    budget."""

    epoch: float  # s since 1970 at which the clock of `now` was 0
    round_trip: RoundTrip = field(default_factory=RoundTrip)
    path_budget: PathBudget = field(default_factory=PathBudget)
    numbers: TransportNumbers = field(default_factory=TransportNumbers)


class OutgoingStream:
    def __init__(self, parameters: OutgoingParameters, share: PathShare, *, paced: bool) -> None:
        """`paced`: True if keyframes are spread; sound is never held back."""
        self.parameters = parameters
        self.sink = Sink()
        ssrc, round_trip = parameters.ssrc, share.round_trip
        chain: Stage = ExtensionWriter(self.sink, parameters.extension_ids, parameters.fixed_values, share.numbers)
        self.pacer = Pacer(chain, share.path_budget) if paced else None
        self.requests = Requests(self.pacer or chain, ssrc, round_trip)
        chain = self.requests
        self.history = History(chain, ssrc, round_trip, parameters.repair) if parameters.repeats else None
        self.reports = SenderReports(
            self.history or chain, ssrc, parameters.clock_rate, parameters.cname, share.epoch, round_trip
        )
        self._next = parameters.first_sequence_number

    def send(
        self,
        payloads: Sequence[bytes],
        media_time: int,
        now: float,
        *,
        marker: bool = True,
        values: Mapping[str, bytes] | None = None,
        captured_at: float | None = None,
    ) -> None:
        """Send one frame.

        Args:
            payloads: of its packets, each at most MAX_PAYLOAD bytes
            media_time: in the codec's clock, from any beginning
            marker: True if the last packet says that the frame is whole
            values: of header extensions, by URI
            captured_at: time on the clock of `now`; None: now

        Raises:
            ValueError: a payload is too long.
        """
        if any(len(payload) > MAX_PAYLOAD for payload in payloads):
            raise ValueError(f"a payload of more than {MAX_PAYLOAD} bytes")
        parameters = self.parameters
        timestamp = (parameters.timestamp_offset + media_time) & 0xFFFFFFFF
        last = len(payloads) - 1
        for place, payload in enumerate(payloads):
            packet = RtpPacket(
                parameters.payload_type,
                self._next & 0xFFFF,
                timestamp,
                parameters.ssrc,
                payload,
                marker and place == last,
                values=values or {},
                captured_at=captured_at,
            )
            self._next += 1
            self.reports.rtp(packet, now)

    def rtcp(self, packet: RtcpPacket, now: float) -> None:
        """Take an RTCP packet of the peer; parts about other streams have no effect here."""
        self.reports.rtcp(packet, now)

    def close(self, now: float) -> None:
        """End the stream with a goodbye."""
        self.reports.goodbye(now)

    def timer(self) -> float | None:
        return self.reports.timer()

    def handle_timer(self, now: float) -> None:
        self.reports.handle_timer(now)

    def packets_to_send(self) -> list[bytes]:
        """Return the RTP packets, before encryption."""
        return [packet.pack() for packet in self.sink.drain_packets()]

    def controls_to_send(self) -> list[RtcpPacket]:
        return self.sink.drain_controls()

    def events(self) -> list[StreamEvent]:
        return self.sink.drain_events()
