"""RTP and RTCP packets of one sender (RFC 3550), before encryption. No socket, no clock is read here."""

import secrets
import struct
from dataclasses import dataclass

from server.media.frame import EncodedFrame
from server.media.header_extensions import ExtensionWriter, pack_send_time
from server.media.sent_history import SentFrame, SentHistory

__all__ = ["PacketStream", "SenderStats", "StreamParameters"]

RTP_HEADER = 12  # bytes
REPORTS_KEPT = 16  # sender reports that an answer may name; over a satellite the newest is not the one
FIRST_ROUND_TRIP = 0.1  # s, before one was measured
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
    not_repeated: int = 0  # packets asked for again while they were on their way
    keyframe_requests: int = 0  # PLI and FIR
    failed: int = 0  # frames that the transport refused
    packets_lost: int = 0  # reported by the peer
    highest_sequence: int = 0  # reported by the peer, extended by its wraps
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
        self._history = SentHistory()
        self._media_time = -1  # of the last frame
        self._last: tuple[int, float] | None = None  # RTP timestamp and capture time of the last frame
        self._reports: dict[int, float] = {}  # middle of the NTP time sent, and when, oldest first
        self._repaired_at = float("-inf")  # when the last retransmission left
        self.stats = SenderStats()

    def packets(self, frame: EncodedFrame, send_time: float) -> list[bytes]:
        """The packets of a frame that leaves at `send_time` (s since 1970)."""
        parameters = self._parameters
        payloads = frame.payloads(parameters.trailer)
        extension = self._extensions.block(frame.stamp, frame.capture_time, send_time)
        # A peer that changes its tier gets one picture of both: a frame of its own needs a time of its own.
        self._media_time = max(self._media_time + 1, frame.media_time)
        timestamp = (self._timestamp_offset + self._media_time) & 0xFFFFFFFF
        octets = sum(map(len, payloads))
        self._history.append(SentFrame(self._sent, payloads, extension, timestamp, frame.marker, octets, send_time))
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
        self.stats.octets += octets
        return packets

    def retransmission(self, sequence_number: int, now: float) -> bytes | None:
        """The packet to send for a NACK of `sequence_number`, stamp included; None when it is gone or too much.

        `now` is in s since 1970. What was sent again less than a round trip ago is not sent once more.
        """
        found = self._history.find(sequence_number & 0xFFFF, self._sequence_origin)
        if found is None:
            self.stats.not_retransmitted += 1
            return None
        frame, index = found
        if self._history.on_its_way(frame.first + index, now, self.round_trip):
            self.stats.not_repeated += 1
            return None
        if not self._history.spend(frame.first + index, now):
            self.stats.not_retransmitted += 1
            return None
        self.stats.retransmitted += 1
        self._repaired_at = now
        parameters = self._parameters
        kind, number, ssrc, payload = parameters.payload_type, sequence_number, parameters.ssrc, frame.payloads[index]
        if parameters.rtx_payload_type is not None:  # RFC 4588 4
            payload = (sequence_number & 0xFFFF).to_bytes(2, "big") + payload
            kind, number, ssrc = parameters.rtx_payload_type, self._rtx_sequence, parameters.rtx_ssrc
            self._rtx_sequence += 1
        marker = 0x80 if frame.marker and index == len(frame.payloads) - 1 else 0
        flags = 0x90 if frame.extension else 0x80
        header = _pack_header(flags, kind | marker, number & 0xFFFF, frame.timestamp, ssrc)
        return self.stamp_send_time(header + frame.extension + payload, now)

    @property
    def round_trip(self) -> float:
        """s; an assumption before one was measured."""
        measured = self.stats.round_trip_ms
        return FIRST_ROUND_TRIP if measured is None else measured / 1000

    def repair_time(self, now: float) -> float:
        """Seconds until the peer may have got what was sent again last; 0 when nothing is on its way."""
        return max(0.0, self._repaired_at + self.round_trip - now)

    def stamp_send_time(self, packet: bytes, send_time: float) -> bytes:
        """`packet`, leaving at `send_time` (s since 1970) and not when it was packed.

        A receiver's bandwidth estimate reads a packet that waited here as one that waited in the network.
        """
        offset = self._extensions.send_time_offset
        if offset is None:
            return packet
        start = RTP_HEADER + offset
        return packet[:start] + pack_send_time(send_time) + packet[start + 3 :]

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
        self._reports[ntp >> 16 & 0xFFFFFFFF] = now
        if len(self._reports) > REPORTS_KEPT:
            del self._reports[next(iter(self._reports))]
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
        self,
        *,
        fraction_lost: int,
        packets_lost: int,
        jitter: int,
        last_report: int,
        delay: int,
        now: float,
        highest_sequence: int = 0,
    ) -> float | None:
        """A report block of the peer about this stream (RFC 3550 6.4.1); the round trip that it tells, in s, if any."""
        stats = self.stats
        stats.fraction_lost = fraction_lost / 256
        stats.packets_lost = packets_lost
        stats.highest_sequence = highest_sequence
        stats.jitter_ms = jitter * 1000 / self._parameters.clock_rate
        sent_at = self._reports.get(last_report)
        if sent_at is None:
            return None
        round_trip = max(0.0, now - sent_at - delay / 65536)
        stats.round_trip_ms = round_trip * 1000
        return round_trip
