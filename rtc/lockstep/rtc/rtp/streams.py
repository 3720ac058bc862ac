"""All streams to and from one peer, as its session description says: from frames to RTP and back, without I/O.

Packets are plain here; encryption is around this module.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from random import Random

from lockstep.rtc.rtp.errors import RtpError
from lockstep.rtc.rtp.history import RepairStream
from lockstep.rtc.rtp.incoming import IncomingParameters, IncomingStream
from lockstep.rtc.rtp.outgoing import OutgoingParameters, OutgoingStream, PathShare
from lockstep.rtc.rtp.router import Route, Router
from lockstep.rtc.rtp.stage import StreamEvent, earliest
from lockstep.rtc.rtp.wire.packet import RtpPacket
from lockstep.rtc.rtp.wire.rtcp import (
    ReceiverReport,
    RtcpPacket,
    SenderReport,
    SourceDescription,
    pack_rtcp,
    parse_rtcp,
)
from lockstep.rtc.sdp import MID_URI, Codec, Direction, MediaSection

__all__ = ["Identity", "NegotiatedMedia", "Streams"]

MAX_COMPOUND = 1200  # bytes of one RTCP datagram, before encryption
REPAIRED = ("nack",)  # a=rtcp-fb of a peer that asks for packets again, or keeps them


@dataclass(frozen=True, slots=True)
class Identity:
    """The name and the SSRC of this side in RTP."""

    cname: str
    ssrc: int  # for reports where nothing is sent

    @classmethod
    def new(cls, random: Random) -> "Identity":
        return cls(f"{random.getrandbits(96):024x}", random.getrandbits(32))  # RFC 7022 4.2


@dataclass(frozen=True, slots=True)
class NegotiatedMedia:
    """One section, after the answer."""

    section: MediaSection  # the answer's: codecs and header extensions in use
    direction: Direction  # that of this side
    ssrc: int  # of the outgoing stream
    repair_ssrc: int
    announced: frozenset[int] = frozenset()  # SSRCs that the peer has named

    @property
    def codec(self) -> Codec:
        """The codec of the outgoing stream."""
        return next(codec for codec in self.section.codecs if codec.repairs is None)


class Streams:
    """The streams of one peer. `counts`: "rtp_malformed", "rtcp_malformed", and packets that no section wants."""

    def __init__(self, media: Sequence[NegotiatedMedia], identity: Identity, share: PathShare, random: Random) -> None:
        self.counts: Counter[str] = Counter()
        self.share = share
        self._identity = identity
        self.outgoing = {
            each.section.mid: _outgoing(each, identity, share, random)
            for each in media
            if each.direction in ("sendrecv", "sendonly")
        }
        receiving = [each for each in media if each.direction in ("sendrecv", "recvonly")]
        self.incoming = {each.section.mid: _incoming(each, identity, share) for each in receiving}
        self._router = Router(_route(each) for each in receiving)

    def receive_rtp(self, data: bytes, now: float) -> None:
        """Take a decrypted RTP packet."""
        try:
            packet = RtpPacket.parse(data)
        except RtpError:
            self.counts["rtp_malformed"] += 1
            return
        mid = self._router.route(packet)
        if mid is None:
            self.counts["rtp_unknown"] += 1
        else:
            self.incoming[mid].rtp(packet, now)

    def receive_rtcp(self, data: bytes, now: float) -> None:
        """Take a decrypted compound RTCP packet."""
        try:
            packets = parse_rtcp(data)
        except RtpError:
            self.counts["rtcp_malformed"] += 1
            return
        for packet in packets:
            for stream in self._all():
                stream.rtcp(packet, now)  # each takes the parts about itself

    def holds_back(self, mid: str) -> bool:
        """True if packets of the outgoing stream in section `mid` wait for its pacer. `PacketsLeft` follows."""
        stream = self.outgoing.get(mid)
        return stream is not None and stream.pacer is not None and stream.pacer.holds

    def report_every(self, seconds: float) -> None:
        """Send sender reports every `seconds` (RFC 3550 6.2), from the report after the next on."""
        for stream in self.outgoing.values():
            stream.reports.interval = seconds

    def timer(self) -> float | None:
        return earliest(*(stream.timer() for stream in self._all()))

    def handle_timer(self, now: float) -> None:
        dues = [stream.reports.due() for stream in self.outgoing.values()]
        one_reports = any(due is not None and now >= due for due in dues)
        for stream in self._all():
            stream.handle_timer(now)
        for stream in self.outgoing.values() if one_reports else ():
            stream.reports.report_early(now)

    def close(self, now: float) -> None:
        """Say goodbye for every outgoing stream."""
        for stream in self.outgoing.values():
            stream.close(now)

    def rtp_to_send(self) -> list[bytes]:
        """Return the RTP packets to send, before encryption."""
        return [packet for stream in self.outgoing.values() for packet in stream.packets_to_send()]

    def rtcp_to_send(self) -> list[bytes]:
        """Return the compound packets to send, before encryption."""
        return self.compounds([packet for stream in self._all() for packet in stream.controls_to_send()])

    def compounds(self, controls: Sequence[RtcpPacket]) -> list[bytes]:
        """Return `controls` as compound packets, before encryption."""
        return list(_compounds(controls, self._identity)) if controls else []

    def packets(self) -> Iterator[tuple[str, RtpPacket]]:
        """Yield the received packets, each with its mid."""
        for mid, stream in self.incoming.items():
            for packet in stream.packets():
                yield mid, packet

    def events(self) -> Iterator[tuple[str, StreamEvent]]:
        """Yield the events of all streams, each with its mid."""
        ways: tuple[Mapping[str, OutgoingStream | IncomingStream], ...] = (self.outgoing, self.incoming)
        for way in ways:
            for mid, stream in way.items():
                for event in stream.events():
                    yield mid, event

    def _all(self) -> Iterator[OutgoingStream | IncomingStream]:
        yield from self.outgoing.values()
        yield from self.incoming.values()


def _outgoing(media: NegotiatedMedia, identity: Identity, share: PathShare, random: Random) -> OutgoingStream:
    section, codec = media.section, media.codec
    repair = section.repair_of(codec)
    parameters = OutgoingParameters(
        ssrc=media.ssrc,
        payload_type=codec.payload_type,
        clock_rate=codec.clock_rate,
        cname=identity.cname,
        first_sequence_number=random.getrandbits(15),
        timestamp_offset=random.getrandbits(32),
        extension_ids={each.uri: each.id for each in section.extensions if each.direction != "inactive"},
        fixed_values={MID_URI: section.mid.encode()},
        repair=RepairStream(media.repair_ssrc, repair.payload_type, random.getrandbits(15)) if repair else None,
        repeats=any(each in codec.feedback for each in REPAIRED),
    )
    return OutgoingStream(parameters, share, paced=section.kind == "video")


def _incoming(media: NegotiatedMedia, identity: Identity, share: PathShare) -> IncomingStream:
    codecs = media.section.codecs
    parameters = IncomingParameters(
        own_ssrc=media.ssrc if media.direction == "sendrecv" else identity.ssrc,
        clock_rates={codec.payload_type: codec.clock_rate for codec in codecs if codec.repairs is None},
        extension_ids={each.uri: each.id for each in media.section.extensions},
        repair_types={codec.payload_type: codec.repairs for codec in codecs if codec.repairs is not None},
        asks_again=any(each in codec.feedback for codec in codecs for each in REPAIRED),
    )
    return IncomingStream(parameters, share.round_trip)


def _route(media: NegotiatedMedia) -> Route:
    section = media.section
    payload_types = frozenset(codec.payload_type for codec in section.codecs)
    return Route(section.mid, payload_types, media.announced, section.extension_id(MID_URI))


def _compounds(controls: Sequence[RtcpPacket], identity: Identity) -> Iterator[bytes]:
    """Yield compound packets with a report first, and a name (RFC 3550 6.1); each fits one datagram."""
    reports = [each for each in controls if isinstance(each, SenderReport | ReceiverReport)]
    others = [each for each in controls if not isinstance(each, SenderReport | ReceiverReport)]
    ssrc = reports[0].ssrc if reports else identity.ssrc
    lead: list[RtcpPacket] = [] if reports else [ReceiverReport(ssrc)]
    if not any(isinstance(each, SourceDescription) for each in others):
        others.insert(0, SourceDescription(((ssrc, identity.cname),)))
    compound = b""
    for packed in (each.pack() for each in [*lead, *reports, *others]):
        if compound and len(compound) + len(packed) > MAX_COMPOUND:
            yield compound
            compound = pack_rtcp([ReceiverReport(ssrc)])
        compound += packed
    yield compound
