"""The stage that counts sent packets, reports them, and reads the peer's reports (RFC 3550 6.4)."""

from dataclasses import dataclass

from lockstep.rtc.rtp.stage import Reception, RoundTrip, Stage
from lockstep.rtc.rtp.wire.packet import RtpPacket
from lockstep.rtc.rtp.wire.rtcp import Goodbye, ReceiverReport, ReportBlock, RtcpPacket, SenderReport, SourceDescription

__all__ = ["SenderReports", "SenderReportSettings"]

NTP_EPOCH = 2_208_988_800  # s from 1900 to 1970
MOST_EXPECTED = 100_000  # packets between two reports of a peer; more is invalid


@dataclass(frozen=True, slots=True)
class SenderReportSettings:
    interval: float = 1.0  # s; RFC 3550 6.2 would let video report more often, without benefit
    remembered: int = 16  # reports that an answer may name; over a satellite the newest is not the one


class SenderReports(Stage):
    def __init__(
        self,
        following: Stage,
        ssrc: int,
        clock_rate: int,
        cname: str,
        epoch: float,
        round_trip: RoundTrip,
        settings: SenderReportSettings | None = None,
    ) -> None:
        """`clock_rate` in Hz; `epoch`: s since 1970 at which the clock of `now` was 0."""
        super().__init__(following)
        self.packets = 0  # sent, without retransmissions
        self.octets = 0  # of their payload
        self.newest: ReportBlock | None = None  # from the peer
        self._ssrc = ssrc
        self._clock_rate = clock_rate
        self._cname = cname
        self._epoch = epoch
        self._round_trip = round_trip
        self._settings = settings or SenderReportSettings()
        self.interval = self._settings.interval  # s
        self._last: tuple[int, float] | None = None  # RTP timestamp and capture time of one sample
        self._due: float | None = None
        self._sent: dict[int, float] = {}  # from the middle of a report's NTP time to its sending; the oldest first

    def rtp(self, packet: RtpPacket, now: float) -> None:
        self.packets += 1
        self.octets += len(packet.payload)
        self._last = packet.timestamp, now if packet.captured_at is None else packet.captured_at
        super().rtp(packet, now)
        if self._due is None:
            self._report(now)

    def due(self) -> float | None:
        return self._due

    def handle_timer(self, now: float) -> None:
        if self._due is not None and now >= self._due:
            self._report(now)
        super().handle_timer(now)

    def report_early(self, now: float) -> None:
        """Report early if the turn of this stream is near: another stream of the peer reports now, and one packet has
        room for both."""
        if self._due is not None and now >= self._due - self.interval / 2:
            self._report(now)

    def goodbye(self, now: float) -> None:
        """End the stream (RFC 3550 6.6); no effect if it never began."""
        if self._due is not None:
            self._report(now)
            self._due = None
            self.control(Goodbye((self._ssrc,)), now)

    def _report(self, now: float) -> None:
        if self._last is None:
            return
        self._due = now + self.interval
        timestamp, captured_at = self._last
        ntp_time = round((now + self._epoch + NTP_EPOCH) * 2**32) & (1 << 64) - 1
        at = (timestamp + round((now - captured_at) * self._clock_rate)) & 0xFFFFFFFF
        self._sent[ntp_time >> 16 & 0xFFFFFFFF] = now
        if len(self._sent) > self._settings.remembered:
            del self._sent[next(iter(self._sent))]
        counts = self.packets & 0xFFFFFFFF, self.octets & 0xFFFFFFFF
        self.control(SenderReport(self._ssrc, ntp_time, at, *counts), now)
        self.control(SourceDescription(((self._ssrc, self._cname),)), now)

    def rtcp(self, packet: RtcpPacket, now: float) -> None:
        if isinstance(packet, ReceiverReport | SenderReport):
            for block in packet.blocks:
                if block.ssrc == self._ssrc:
                    self._reported(block, now)
        super().rtcp(packet, now)

    def _reported(self, block: ReportBlock, now: float) -> None:
        sent_at = self._sent.get(block.last_report)
        round_trip = None
        if sent_at is not None:
            round_trip = max(0.0, now - sent_at - block.delay / 65536)
            self._round_trip.measure(round_trip)
        before, self.newest = self.newest, block
        expected = lost = 0
        if before is not None and 0 < block.highest_sequence - before.highest_sequence <= MOST_EXPECTED:
            expected = block.highest_sequence - before.highest_sequence
            lost = min(max(0, block.packets_lost - before.packets_lost), expected)
        self.event(Reception(self._ssrc, expected, lost, block, round_trip))
