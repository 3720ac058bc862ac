"""The stage that counts received packets and reports them (RFC 3550 6.4.2, A.3, A.8)."""

from dataclasses import dataclass

from lockstep.rtc.rtp.stage import Stage, StreamEnded
from lockstep.rtc.rtp.wire.numbers import Unwrapper
from lockstep.rtc.rtp.wire.packet import RtpPacket
from lockstep.rtc.rtp.wire.rtcp import Goodbye, ReceiverReport, ReportBlock, RtcpPacket, SenderReport

__all__ = ["ReceiverReports", "ReceiverReportSettings"]

MAX_JITTER = 10.0  # s; more shows a sender that began to count anew


@dataclass(frozen=True, slots=True)
class ReceiverReportSettings:
    interval: float = 1.0  # s


class ReceiverReports(Stage):
    def __init__(
        self,
        following: Stage,
        own_ssrc: int,
        ssrc: int,
        clock_rate: int,
        settings: ReceiverReportSettings | None = None,
    ) -> None:
        """`ssrc`: that of the stream; `own_ssrc`: that of the reporter; `clock_rate` in Hz."""
        super().__init__(following)
        self.packets = 0  # packets that came, counted every time they came
        self.newest_report: SenderReport | None = None  # from the peer; it tells capture times
        self._own_ssrc = own_ssrc
        self._ssrc = ssrc
        self._clock_rate = clock_rate
        self._settings = settings or ReceiverReportSettings()
        self._numbers = Unwrapper()
        self._timestamps = Unwrapper(32)
        self._first: int | None = None
        self._highest = 0
        self._expected_before = self._packets_before = 0  # at the last report
        self._transit: float | None = None  # arrival minus timestamp, in the codec's clock
        self._timestamp: int | None = None
        self._jitter = 0.0  # in the codec's clock
        self._report_at = 0.0  # arrival of the newest sender report
        self._due: float | None = None

    @property
    def jitter(self) -> float:
        """The jitter in s."""
        return self._jitter / self._clock_rate

    def rtp(self, packet: RtpPacket, now: float) -> None:
        if packet.ssrc == self._ssrc:  # a retransmission has another: it hides no loss (RFC 4588 4)
            self._count(packet, now)
        super().rtp(packet, now)

    def _count(self, packet: RtpPacket, now: float) -> None:
        self.packets += 1
        number = self._numbers.unwrap(packet.sequence_number)
        if self._first is None:
            self._first = self._highest = number
            self._due = now + self._settings.interval
        self._highest = max(self._highest, number)
        if packet.timestamp != self._timestamp:  # once a frame: its packets share a time
            self._note_jitter(packet.timestamp, now)

    def _note_jitter(self, timestamp: int, now: float) -> None:
        transit = now * self._clock_rate - self._timestamps.unwrap(timestamp)
        if self._transit is not None:
            difference = abs(transit - self._transit)
            if difference < MAX_JITTER * self._clock_rate:
                self._jitter += (difference - self._jitter) / 16  # RFC 3550 A.8
        self._transit, self._timestamp = transit, timestamp

    def rtcp(self, packet: RtcpPacket, now: float) -> None:
        if isinstance(packet, SenderReport) and packet.ssrc == self._ssrc:
            self.newest_report, self._report_at = packet, now
        elif isinstance(packet, Goodbye) and self._ssrc in packet.sources:
            self._due = None
            self.event(StreamEnded(self._ssrc))
        super().rtcp(packet, now)

    def due(self) -> float | None:
        return self._due

    def handle_timer(self, now: float) -> None:
        if self._due is not None and now >= self._due:
            self._due = now + self._settings.interval
            self.control(ReceiverReport(self._own_ssrc, (self._block(now),)), now)
        super().handle_timer(now)

    def _block(self, now: float) -> ReportBlock:
        expected = self._highest - (self._first or 0) + 1
        due, came = expected - self._expected_before, self.packets - self._packets_before
        self._expected_before, self._packets_before = expected, self.packets
        last_report = self.newest_report.ntp_time >> 16 & 0xFFFFFFFF if self.newest_report else 0
        return ReportBlock(
            ssrc=self._ssrc,
            fraction_lost=0 if due <= 0 else min(255, max(0, due - came) * 256 // due),
            packets_lost=min(0x7FFFFF, max(-0x800000, expected - self.packets)),
            highest_sequence=self._highest & 0xFFFFFFFF,
            jitter=min(0xFFFFFFFF, int(self._jitter)),
            last_report=last_report,
            delay=min(0xFFFFFFFF, round((now - self._report_at) * 65536)) if last_report else 0,
        )
