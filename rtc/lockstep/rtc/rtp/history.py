"""The stage that keeps sent packets, and sends them again when the peer asks (RFC 4585 6.2.1, RFC 4588)."""

from collections import OrderedDict
from dataclasses import dataclass, replace

from lockstep.rtc.rtp.feedback import Nack
from lockstep.rtc.rtp.stage import RoundTrip, Stage
from lockstep.rtc.rtp.wire.packet import RtpPacket
from lockstep.rtc.rtp.wire.rtcp import RtcpPacket

__all__ = ["History", "HistorySettings", "RepairStream"]


@dataclass(frozen=True, slots=True)
class HistorySettings:
    seconds: float = 2.5  # s to keep a packet; a path over a satellite needs 0.6 s for one try, and may lose that
    packets: int = 4096  # kept; two and a half seconds of 15 Mbit/s
    octets: int = 3_000_000  # kept, of payload
    burst: int = 200  # packets that may be sent again at once
    rate: float = 1000.0  # packets/s that may be sent again; a peer's NACKs cannot cause a flood of them


@dataclass(frozen=True, slots=True)
class RepairStream:
    """The stream of retransmissions (RFC 4588 4)."""

    ssrc: int
    payload_type: int
    first_sequence_number: int


@dataclass(slots=True)
class _Kept:
    packet: RtpPacket
    sent_at: float
    repeated_at: float = float("-inf")


class History(Stage):
    """Keeps sent packets. It stands before the extensions are written: a retransmission says anew when it leaves."""

    def __init__(
        self,
        following: Stage,
        ssrc: int,
        round_trip: RoundTrip,
        repair: RepairStream | None = None,
        settings: HistorySettings | None = None,
    ) -> None:
        """`repair`: None where RFC 4588 is not in use, and the packet itself is sent again."""
        super().__init__(following)
        self.retransmitted = 0  # packets
        self.refused = 0  # packets asked for that are forgotten, or over the rate
        self.on_their_way = 0  # packets asked for again less than a round trip after they were sent again
        self._ssrc = ssrc
        self._round_trip = round_trip
        self._repair = repair
        self._repair_number = repair.first_sequence_number if repair is not None else 0
        self._settings = settings or HistorySettings()
        self._kept: OrderedDict[int, _Kept] = OrderedDict()  # by sequence number, the oldest first
        self._octets = 0
        self._budget = float(self._settings.burst)
        self._budget_at = 0.0

    def rtp(self, packet: RtpPacket, now: float) -> None:
        before = self._kept.pop(packet.sequence_number, None)  # the packet with this number one turn ago
        if before is not None:
            self._octets -= len(before.packet.payload)
        self._kept[packet.sequence_number] = _Kept(packet, now)
        self._octets += len(packet.payload)
        while self._is_too_much(now):
            _, oldest = self._kept.popitem(last=False)
            self._octets -= len(oldest.packet.payload)
        super().rtp(packet, now)

    def _is_too_much(self, now: float) -> bool:
        limits, oldest = self._settings, next(iter(self._kept.values()))
        too_old = now - oldest.sent_at > limits.seconds
        return len(self._kept) > 1 and (too_old or len(self._kept) > limits.packets or self._octets > limits.octets)

    def rtcp(self, packet: RtcpPacket, now: float) -> None:
        if isinstance(packet, Nack) and packet.media_ssrc == self._ssrc:
            for number in packet.lost:
                self._retransmit(number, now)
        super().rtcp(packet, now)

    def _retransmit(self, number: int, now: float) -> None:
        kept = self._kept.get(number)
        if kept is None:
            self.refused += 1
        elif now - kept.repeated_at < self._round_trip.seconds:
            self.on_their_way += 1  # the peer cannot have it yet
        elif not self._spend(now):
            self.refused += 1
        else:
            kept.repeated_at = now
            self.retransmitted += 1
            super().rtp(self._repeated(kept.packet), now)

    def _repeated(self, packet: RtpPacket) -> RtpPacket:
        if self._repair is None:
            return replace(packet, extensions={}, is_repair=True)
        number, self._repair_number = self._repair_number, self._repair_number + 1
        return replace(
            packet,
            ssrc=self._repair.ssrc,
            payload_type=self._repair.payload_type,
            sequence_number=number & 0xFFFF,
            payload=packet.sequence_number.to_bytes(2, "big") + packet.payload,  # RFC 4588 4
            extensions={},
            is_repair=True,
        )

    def _spend(self, now: float) -> bool:
        limits = self._settings
        self._budget = min(float(limits.burst), self._budget + (now - self._budget_at) * limits.rate)
        self._budget_at = now
        if self._budget < 1:
            return False
        self._budget -= 1
        return True
