"""Receiver reports (RFC 3550 6.4.2) for streams that are only counted. Bytes only, no I/O."""

import struct
from dataclasses import dataclass

from lockstep.client.media.rtp_header import RtpHeader

__all__ = ["ReceiverReports"]

SEQUENCES = 1 << 16
RTCP_SR, RTCP_RR = 200, 201
MOST_BLOCKS = 31
SENDER_REPORT = 28  # bytes, at least


@dataclass(slots=True)
class _Source:
    """The counts of one stream."""

    clock_rate: int  # Hz
    first: int | None = None  # sequence number
    highest: int = 0  # sequence number, extended by its wraps
    received: int = 0
    expected_before: int = 0  # at the last report
    received_before: int = 0
    transit: float | None = None  # arrival minus timestamp, in the clock's units
    timestamp: int = 0
    jitter: float = 0.0  # in the clock's units
    report: int = 0  # middle of the last sender report's time
    report_at: float = 0.0  # s, its arrival


class ReceiverReports:
    """Makes receiver reports. Pass it packets and the sender's reports; call `report` about once a second."""

    def __init__(self, own_ssrc: int) -> None:
        self._own = own_ssrc
        self._sources: dict[int, _Source] = {}

    def add(self, ssrc: int, clock_rate: int) -> None:
        """Report on this stream from now on."""
        self._sources[ssrc] = _Source(clock_rate)

    def packet(self, header: RtpHeader, now: float) -> None:
        """Count a packet that arrived."""
        source = self._sources.get(header.ssrc)
        if source is None:
            return
        source.received += 1
        if source.first is None:
            source.first = source.highest = header.sequence
        else:
            ahead = (header.sequence - source.highest) % SEQUENCES
            if ahead < SEQUENCES // 2:
                source.highest += ahead
        if source.transit is None or header.timestamp != source.timestamp:  # once a frame: its packets share a time
            source.timestamp = header.timestamp
            self._note_jitter(source, now * source.clock_rate - header.timestamp)

    def _note_jitter(self, source: _Source, transit: float) -> None:
        if source.transit is not None:
            difference = abs(transit - source.transit)
            if difference < 10 * source.clock_rate:  # not where the timestamp wraps
                source.jitter += (difference - source.jitter) / 16
        source.transit = transit

    def control(self, data: bytes, now: float) -> None:
        """Take a compound RTCP packet that arrived; all but sender reports are left out."""
        if len(data) >= SENDER_REPORT and data[1] == RTCP_SR:
            source = self._sources.get(int.from_bytes(data[4:8], "big"))
            if source is not None:
                source.report, source.report_at = int.from_bytes(data[10:14], "big"), now

    def report(self, now: float) -> bytes | None:
        """Return the report to send; None before the first packet."""
        blocks = [
            self._block(ssrc, source, source.first, now)
            for ssrc, source in self._sources.items()
            if source.first is not None
        ][:MOST_BLOCKS]
        if not blocks:
            return None
        words = 1 + 6 * len(blocks)
        return struct.pack("!BBHI", 0x80 | len(blocks), RTCP_RR, words, self._own) + b"".join(blocks)

    @staticmethod
    def _block(ssrc: int, source: _Source, first: int, now: float) -> bytes:
        expected = source.highest - first + 1
        due, came = expected - source.expected_before, source.received - source.received_before
        source.expected_before, source.received_before = expected, source.received
        fraction = 0 if due <= 0 else min(255, max(0, due - came) * 256 // due)
        lost = min(0x7FFFFF, max(-0x800000, expected - source.received)) & 0xFFFFFF
        delay = min(0xFFFFFFFF, round((now - source.report_at) * 65536)) if source.report else 0
        return struct.pack(
            "!IIIIII",
            ssrc,
            fraction << 24 | lost,
            source.highest & 0xFFFFFFFF,
            min(0xFFFFFFFF, int(source.jitter)),
            source.report,
            delay,
        )
