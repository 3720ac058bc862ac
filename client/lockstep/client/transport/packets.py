"""Hands the packets of a connection to the consumer of each section."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

from lockstep.client.media.frame_assembler import MediaPacket
from lockstep.client.media.payloads import UNPACK
from lockstep.client.transport.sdp import Section
from lockstep.protocol.carriers import (
    CAPTURE_TIME_URI,
    EVENT_REFERENCE_URI,
    Carrier,
    unpack_capture_moment,
    unpack_capture_time,
    unpack_event_reference,
)
from lockstep.rtc.endpoint import Connection
from lockstep.rtc.peer import PeerNotReady
from lockstep.rtc.peer_events import PacketReceived, PeerEvent, PlainRtcp, PlainRtp
from lockstep.rtc.rtp.wire.packet import RtpPacket
from lockstep.rtc.rtp.wire.payloads import PayloadError

__all__ = ["EXTENSION_URIS", "PacketSink", "Packets", "stamp_reader"]

EXTENSION_URIS: dict[Carrier, str] = {"native": EVENT_REFERENCE_URI, "capture-time": CAPTURE_TIME_URI}


def stamp_reader(carrier: Carrier) -> Callable[[bytes], int | None]:
    """Return the function that reads the header extension of `carrier`."""
    return unpack_capture_time if carrier == "capture-time" else unpack_event_reference


class PacketSink(Protocol):
    """Takes the packets of one media section."""

    def packet(self, payload_type: int, packet: MediaPacket) -> bool:
        """Take one packet; return True if the sender should be asked for a keyframe."""


class Packets:
    """Passes packets to their consumers. `to_sinks` or `plain` before the answer, then `heard` with every event."""

    def __init__(self, connection: Connection, carrier: Carrier, *, of_relay: bool = False) -> None:
        """`of_relay`: packets come from a relay, to which no round trip is measured; the assumed one suffices."""
        self.carrier = carrier
        self.counts: Counter[str] = Counter()  # packets that were dropped, by reason
        self._connection = connection
        self._of_relay = of_relay
        self._sinks: Mapping[str, PacketSink] = {}  # by mid
        self._codecs: dict[tuple[str, int], Callable[[bytes], bytes]] = {}  # by mid and payload type
        self._stamp_uri = EXTENSION_URIS.get(carrier)
        self._read_stamp = stamp_reader(carrier)
        self._take: Callable[[bytes], None] = lambda data: None
        self._control: Callable[[bytes], None] = lambda data: None

    def extension_id(self, sections: Sequence[Section]) -> int | None:
        """Return the id under which the carrier's header extension is sent; None: the stamp is behind the frame."""
        uri = self._stamp_uri
        return next((section.extensions[uri] for section in sections if uri and uri in section.extensions), None)

    def to_sinks(self, sinks: Mapping[str, PacketSink], sections: Sequence[Section]) -> None:
        """Pass packets to `sinks`, by mid; ask again for lost ones, and report on received ones."""
        self._sinks = sinks
        for section in sections:
            for number, name in section.codecs.items():
                if name in UNPACK:
                    self._codecs[section.mid, number] = UNPACK[name]

    def plain(self, take: Callable[[bytes], None], control: Callable[[bytes], None]) -> None:
        """Pass every RTP packet to `take` and every RTCP packet to `control`, and do nothing else for them."""
        self._take, self._control = take, control
        self._connection.peer.media.plain = True

    def heard(self, event: PeerEvent) -> None:
        if isinstance(event, PlainRtp):
            self._take(event.data)
        elif isinstance(event, PacketReceived):
            self._packet(event.mid, event.packet)
        elif isinstance(event, PlainRtcp):
            self._control(event.data)

    def _packet(self, mid: str, packet: RtpPacket) -> None:
        sink, unpack = self._sinks.get(mid), self._codecs.get((mid, packet.payload_type))
        if sink is None or unpack is None:
            self.counts["unknown"] += 1
            return
        try:
            data = unpack(packet.payload)
        except PayloadError:
            self.counts["payload"] += 1
            return
        value = packet.values.get(self._stamp_uri) if self._stamp_uri is not None else None
        stamp = self._read_stamp(value) if value is not None else None
        captured = unpack_capture_moment(value) if value is not None else None
        taken = MediaPacket(packet.sequence_number, packet.timestamp, packet.marker, data, stamp, captured)
        if sink.packet(packet.payload_type, taken):
            self._connection.request_keyframe(mid)

    def send_control(self, packet: bytes) -> None:
        """Send an RTCP packet from this side; nothing while media are not up."""
        try:
            self._connection.send_rtcp(packet)
        except PeerNotReady:
            self.counts["control_not_sent"] += 1

    def round_trip(self, seconds: float) -> None:
        """Take the round trip to the console; lost packets are asked for accordingly."""
        if not self._of_relay:
            self._connection.peer.share.round_trip.measure(seconds)
