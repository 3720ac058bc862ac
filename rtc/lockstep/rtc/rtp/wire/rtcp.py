"""RTCP: reports, descriptions and goodbyes (RFC 3550 6), and compound packets. Feedback is in `feedback.py`."""

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from lockstep.rtc.rtp.errors import RtpError
from lockstep.rtc.rtp.feedback import PAYLOAD_FEEDBACK, TRANSPORT_FEEDBACK, Feedback, parse_feedback

__all__ = [
    "Goodbye",
    "ReceiverReport",
    "ReportBlock",
    "RtcpPacket",
    "SenderReport",
    "SourceDescription",
    "UnknownRtcp",
    "pack_rtcp",
    "parse_rtcp",
]

SENDER_REPORT, RECEIVER_REPORT, SOURCE_DESCRIPTION, GOODBYE = 200, 201, 202, 203
CNAME = 1  # RFC 3550 6.5.1
BLOCK = struct.Struct("!IIIIII")
SENDER = struct.Struct("!IQIII")
MAX_COUNT = 31  # of report blocks, chunks or sources: five bits


@dataclass(frozen=True, slots=True)
class ReportBlock:
    """A receiver's report about one stream (RFC 3550 6.4.1)."""

    ssrc: int
    fraction_lost: int  # in 256ths, since the report before
    packets_lost: int  # since the beginning; negative when packets came twice
    highest_sequence: int  # 32 bits: with the number of wraps
    jitter: int  # in the codec's clock
    last_report: int  # middle 32 bits of the newest sender report's NTP time; 0 before the first
    delay: int  # since that report came, in 65536ths of a second

    def pack(self) -> bytes:
        lost = self.fraction_lost << 24 | self.packets_lost & 0xFFFFFF
        return BLOCK.pack(self.ssrc, lost, self.highest_sequence, self.jitter, self.last_report, self.delay)

    @classmethod
    def unpack(cls, data: bytes, position: int) -> "ReportBlock":
        ssrc, lost, highest, jitter, last_report, delay = BLOCK.unpack_from(data, position)
        total = (lost & 0xFFFFFF) - ((lost & 0x800000) << 1)
        return cls(ssrc, lost >> 24, total, highest, jitter, last_report, delay)


@dataclass(frozen=True, slots=True)
class SenderReport:
    ssrc: int
    ntp_time: int  # 32.32 bits, s since 1900
    rtp_timestamp: int  # of the sample captured at that time
    packets: int  # sent, 32 bits
    octets: int  # of payload, 32 bits
    blocks: tuple[ReportBlock, ...] = ()

    def pack(self) -> bytes:
        fixed = SENDER.pack(self.ssrc, self.ntp_time, self.rtp_timestamp, self.packets, self.octets)
        return _pack(SENDER_REPORT, len(self.blocks), fixed + b"".join(each.pack() for each in self.blocks))


@dataclass(frozen=True, slots=True)
class ReceiverReport:
    ssrc: int  # of the reporter
    blocks: tuple[ReportBlock, ...] = ()

    def pack(self) -> bytes:
        blocks = b"".join(each.pack() for each in self.blocks)
        return _pack(RECEIVER_REPORT, len(self.blocks), self.ssrc.to_bytes(4, "big") + blocks)


@dataclass(frozen=True, slots=True)
class SourceDescription:
    """The canonical names of sources; other items are not read."""

    names: tuple[tuple[int, str], ...]  # SSRC and CNAME

    def pack(self) -> bytes:
        chunks = b""
        for ssrc, name in self.names:
            text = name.encode()[:255]
            chunk = struct.pack("!IBB", ssrc, CNAME, len(text)) + text + b"\x00"  # RFC 3550 6.5: at least one zero
            chunks += chunk + bytes(-len(chunk) % 4)
        return _pack(SOURCE_DESCRIPTION, len(self.names), chunks)


@dataclass(frozen=True, slots=True)
class Goodbye:
    sources: tuple[int, ...]

    def pack(self) -> bytes:
        return _pack(GOODBYE, len(self.sources), struct.pack(f"!{len(self.sources)}I", *self.sources))


@dataclass(frozen=True, slots=True)
class UnknownRtcp:
    """A packet of a type that is not read here."""

    packet_type: int
    count: int  # the five bits that mean something else in each type
    body: bytes

    def pack(self) -> bytes:
        return _pack(self.packet_type, self.count, self.body)


RtcpPacket = SenderReport | ReceiverReport | SourceDescription | Goodbye | UnknownRtcp | Feedback


def pack_rtcp(packets: Sequence[RtcpPacket]) -> bytes:
    """Return a compound packet."""
    return b"".join(packet.pack() for packet in packets)


def parse_rtcp(data: bytes) -> list[RtcpPacket]:
    """Return the packets in a compound one, or in one of reduced size (RFC 5506). Raises RtpError."""
    if not data:
        raise RtpError("no RTCP packet")
    return [_parse(kind, count, body) for kind, count, body in _split(data)]


def _split(data: bytes) -> Iterator[tuple[int, int, bytes]]:
    position = 0
    while position < len(data):
        if position + 4 > len(data) or data[position] >> 6 != 2:
            raise RtpError("not an RTCP packet")
        first, kind, words = struct.unpack_from("!BBH", data, position)
        start, position = position + 4, position + 4 + 4 * words
        if position > len(data):
            raise RtpError("an RTCP packet that is cut short")
        end = position
        if first & 0x20:  # padding, of the last packet only (RFC 3550 6.4.1)
            if end == start or position != len(data) or not 0 < data[end - 1] <= end - start:
                raise RtpError("invalid RTCP padding")
            end -= data[end - 1]
        yield kind, first & 0x1F, data[start:end]


def _parse(kind: int, count: int, body: bytes) -> RtcpPacket:
    try:
        if kind == SENDER_REPORT:
            ssrc, ntp_time, timestamp, packets, octets = SENDER.unpack_from(body)
            return SenderReport(ssrc, ntp_time, timestamp, packets, octets, _blocks(body, SENDER.size, count))
        if kind == RECEIVER_REPORT:
            return ReceiverReport(int.from_bytes(_first(body, 4), "big"), _blocks(body, 4, count))
        if kind == SOURCE_DESCRIPTION:
            return SourceDescription(tuple(_names(body, count)))
        if kind == GOODBYE:
            return Goodbye(struct.unpack_from(f"!{count}I", body))
        if kind in (TRANSPORT_FEEDBACK, PAYLOAD_FEEDBACK):
            return parse_feedback(kind, count, body) or UnknownRtcp(kind, count, body)
    except (struct.error, IndexError) as error:
        raise RtpError(f"an RTCP packet of type {kind} that is cut short") from error
    return UnknownRtcp(kind, count, body)


def _first(body: bytes, length: int) -> bytes:
    if len(body) < length:
        raise RtpError("an RTCP packet that is cut short")
    return body[:length]


def _blocks(body: bytes, start: int, count: int) -> tuple[ReportBlock, ...]:
    return tuple(ReportBlock.unpack(body, start + BLOCK.size * number) for number in range(count))


def _names(body: bytes, count: int) -> Iterator[tuple[int, str]]:
    position = 0
    for _ in range(count):
        (ssrc,) = struct.unpack_from("!I", body, position)
        position += 4
        while body[position]:  # items, ended by a zero
            kind, length = body[position], body[position + 1]
            text = body[position + 2 : position + 2 + length]
            if kind == CNAME:
                yield ssrc, text.decode(errors="replace")
            position += 2 + length
        position += 4 - position % 4  # at least one zero, up to the next word


def _pack(kind: int, count: int, body: bytes) -> bytes:
    if count > MAX_COUNT:
        raise ValueError(f"at most {MAX_COUNT} in one RTCP packet")
    return struct.pack("!BBH", 0x80 | count, kind, len(body) // 4) + body
