"""RTP and RTCP packets of one sender (RFC 3550), before encryption. No socket, no clock is read here."""

import secrets
import struct
from dataclasses import dataclass

from server.media.frame import EncodedFrame
from server.media.header_extensions import ExtensionWriter
from server.media.sent_history import SentFrame, SentHistory

__all__ = ["HISTORY_PACKETS", "PacketStream", "SenderStats", "StreamParameters"]

HISTORY_PACKETS = 1024

NTP_EPOCH_OFFSET = 2_208_988_800  # s from 1900 to 1970
RTCP_SR, RTCP_SDES, RTCP_BYE = 200, 202, 203
SDES_CNAME = 1

_pack_header = struct.Struct("!BBHII").pack


@dataclass(slots=True)
class SenderStats:
    """What one sender did and what its peer reported."""

    packets: int = 0  # sent, without retransmissions
    octets: int = 0  # of payload
    frames: int = 0  # sent
    retransmitted: int = 0  # packets
    not_retransmitted: int = 0  # packets asked for, but forgotten or over the budget
    keyframe_requests: int = 0  # PLI and FIR
    failed: int = 0  # frames that the transport refused
    packets_lost: int = 0  # reported by the peer
    fraction_lost: float = 0.0  # reported by the peer, 0 to 1
    jitter_ms: float = 0.0  # reported by the peer
    round_trip_ms: float | None = None  # None before the first report that answers ours
    remb_bps: int | None = None  # the peer's bandwidth estimate; None before the first


@dataclass(frozen=True, slots=True)
class StreamParameters:
    """What was negotiated for one sender."""

    ssrc: int
    rtx_ssrc: int
    payload_type: int
    rtx_payload_type: int | None  # None: the original packet is sent again (RFC 4588 is not in use)
    clock_rate: int  # Hz
    cname: str
    trailer: bool


class PacketStream:
    """Numbers, packs and remembers packets."""

    def __init__(self, parameters: StreamParameters, extensions: ExtensionWriter) -> None:
        self._parameters = parameters
        self._extensions = extensions
        # The lower half keeps the first wrap away from the start (RFC 3711 3.3.1: the roll-over counter is implicit).
        self._sequence_origin = secrets.randbelow(0x8000)
        self._rtx_sequence = secrets.randbelow(0x8000)
        self._timestamp_offset = secrets.randbits(32)
        self._sent = 0  # packets, never wraps
        self._history = SentHistory(HISTORY_PACKETS)
        self._last: tuple[int, float] | None = None  # RTP timestamp and capture time of the last frame
        self._last_report: tuple[int, float] | None = None  # middle of the NTP time sent, and when
        self.stats = SenderStats()

    def packets(self, frame: EncodedFrame, send_time: float) -> list[bytes]:
        """The packets of a frame that leaves at `send_time` (s since 1970)."""
        parameters = self._parameters
        payloads = frame.payloads(parameters.trailer)
        extension = self._extensions.block(frame.stamp, frame.capture_time, send_time)
        timestamp = (self._timestamp_offset + frame.media_time) & 0xFFFFFFFF
        self._history.append(SentFrame(self._sent, payloads, extension, timestamp, frame.marker))
        self._last = timestamp, frame.capture_time
        number = self._sequence_origin + self._sent
        self._sent += len(payloads)
        flags, kind, ssrc = 0x90 if extension else 0x80, parameters.payload_type, parameters.ssrc
        last = number + len(payloads) - 1 if frame.marker else -1
        packets = [
            _pack_header(flags, kind | 0x80 if i == last else kind, i & 0xFFFF, timestamp, ssrc) + extension + payload
            for i, payload in enumerate(payloads, number)
        ]
        self.stats.frames += 1
        self.stats.packets += len(packets)
        self.stats.octets += sum(map(len, payloads))
        return packets

    def retransmission(self, sequence_number: int, now: float) -> bytes | None:
        """The packet to send for a NACK of `sequence_number`, stamp included; None when it is gone or too much."""
        found = self._history.find(sequence_number & 0xFFFF, self._sequence_origin)
        if found is None or not self._history.spend(now):
            self.stats.not_retransmitted += 1
            return None
        self.stats.retransmitted += 1
        frame, index = found
        parameters = self._parameters
        kind, number, ssrc, payload = parameters.payload_type, sequence_number, parameters.ssrc, frame.payloads[index]
        if parameters.rtx_payload_type is not None:  # RFC 4588 4
            payload = (sequence_number & 0xFFFF).to_bytes(2, "big") + payload
            kind, number, ssrc = parameters.rtx_payload_type, self._rtx_sequence, parameters.rtx_ssrc
            self._rtx_sequence += 1
        marker = 0x80 if frame.marker and index == len(frame.payloads) - 1 else 0
        flags = 0x90 if frame.extension else 0x80
        header = _pack_header(flags, kind | marker, number & 0xFFFF, frame.timestamp, ssrc)
        return header + frame.extension + payload

    def report(self, now: float) -> bytes | None:
        """A sender report with CNAME for `now` (s since 1970); None before the first frame.

        Its pair of times says at which wall-clock time the sample with that RTP timestamp was captured
        (RFC 3550 6.4.1), on the same estimate of the capture clock as every stream of this robot.
        """
        if self._last is None:
            return None
        timestamp, capture_time = self._last
        rtp = (timestamp + round((now - capture_time) * self._parameters.clock_rate)) & 0xFFFFFFFF
        ntp = round((now + NTP_EPOCH_OFFSET) * 2**32)
        self._last_report = ntp >> 16 & 0xFFFFFFFF, now
        packets, octets = self.stats.packets & 0xFFFFFFFF, self.stats.octets & 0xFFFFFFFF
        ssrc = self._parameters.ssrc
        return struct.pack("!BBHIQIII", 0x80, RTCP_SR, 6, ssrc, ntp, rtp, packets, octets) + self._sdes()

    def _sdes(self) -> bytes:
        """RFC 3550 6.5: one chunk, one CNAME, ended by at least one zero."""
        cname = self._parameters.cname.encode()[:255]
        chunk = struct.pack("!IBB", self._parameters.ssrc, SDES_CNAME, len(cname)) + cname + b"\x00"
        chunk += b"\x00" * (-len(chunk) % 4)
        return struct.pack("!BBH", 0x81, RTCP_SDES, len(chunk) // 4) + chunk

    def goodbye(self, now: float) -> bytes | None:
        """The last compound packet (RFC 3550 6.6); None when nothing was ever sent."""
        report = self.report(now)
        return report and report + struct.pack("!BBHI", 0x81, RTCP_BYE, 1, self._parameters.ssrc)

    def reported(
        self, *, fraction_lost: int, packets_lost: int, jitter: int, last_report: int, delay: int, now: float
    ) -> None:
        """A report block of the peer about this stream (RFC 3550 6.4.1)."""
        stats = self.stats
        stats.fraction_lost = fraction_lost / 256
        stats.packets_lost = packets_lost
        stats.jitter_ms = jitter * 1000 / self._parameters.clock_rate
        if self._last_report is not None and self._last_report[0] == last_report:
            stats.round_trip_ms = max(0.0, now - self._last_report[1] - delay / 65536) * 1000
