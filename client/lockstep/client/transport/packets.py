"""Hands the packets of a connection to the consumer of each section."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

from lockstep.client.media.frame_assembler import MediaPacket
from lockstep.client.media.payloads import UNPACK
from lockstep.client.transport.sdp import Section
from lockstep.protocol.carriers import unpack_capture_moment
from lockstep.rtc.endpoint import Connection
from lockstep.rtc.peer import PeerNotReady
from lockstep.rtc.peer_events import PacketReceived, PeerEvent, PlainRtcp, PlainRtp
from lockstep.rtc.rtp.packet import RtpPacket
from lockstep.rtc.rtp.payloads import PayloadError

__all__ = ["PacketSink", "Packets"]


class PacketSink(Protocol):
    """Takes the packets of one media section."""

    def packet(self, payload_type: int, packet: MediaPacket) -> bool:
        """Take one packet; return True if the sender should be asked for a keyframe."""


class Packets:
    """Passes packets to their consumers. `to_sinks` or `plain` before the answer, then `heard` with every event."""

    def __init__(self, connection: Connection) -> None:
        self.counts: Counter[str] = Counter()  # packets that were dropped, by reason
        self._connection = connection
        self._sinks: Mapping[str, PacketSink] = {}  # by mid
        self._codecs: dict[tuple[str, int], Callable[[bytes], bytes]] = {}  # by mid and payload type
        self._stamp_uri: str | None = None
        self._read_stamp: Callable[[bytes], int | None] = lambda value: None
        self._take: Callable[[bytes], None] = lambda data: None
        self._control: Callable[[bytes], None] = lambda data: None

    def to_sinks(
        self,
        sinks: Mapping[str, PacketSink],
        sections: Sequence[Section],
        stamp_uri: str | None = None,
        read_stamp: Callable[[bytes], int | None] = lambda value: None,
    ) -> None:
        """Pass packets to `sinks`, by mid; ask again for lost ones, and report on received ones.

        `stamp_uri`: the URI of the header extension that `read_stamp` understands.
        """
        self._sinks, self._stamp_uri, self._read_stamp = sinks, stamp_uri, read_stamp
        for section in sections:
            for number, name in section.codecs.items():
                if name in UNPACK:
                    self._codecs[section.mid, number] = UNPACK[name]

    def plain(self, take: Callable[[bytes], None], control: Callable[[bytes], None]) -> None:
        """Pass every RTP packet to `take` and every RTCP packet to `control`, and do nothing else for them."""
        self._take, self._control = take, control
        self._connection.peer.take_plain_packets()

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
