"""RTP packets (RFC 3550 5.1) and their header extensions (RFC 8285). Bytes only."""

import struct
from collections.abc import Mapping
from dataclasses import dataclass, field

from lockstep.rtc.rtp.errors import RtpError

__all__ = ["RtpPacket", "pack_extensions", "parse_extensions"]

HEADER = struct.Struct("!BBHII")
ONE_BYTE, TWO_BYTE = 0xBEDE, 0x1000  # RFC 8285 4.2, 4.3; the lowest four bits of the latter are free
ONE_BYTE_IDS = range(1, 15)  # 15 ends the list, 0 is padding
ONE_BYTE_LENGTHS = range(1, 17)
MAX_LENGTH = 255  # bytes of one element


@dataclass(slots=True)
class RtpPacket:
    """One packet. Stages fill it in on its way; a stage does not change it after handing it on."""

    payload_type: int
    sequence_number: int  # 16 bits
    timestamp: int  # 32 bits, in the codec's clock
    ssrc: int
    payload: bytes = b""
    marker: bool = False
    csrcs: tuple[int, ...] = ()
    extensions: dict[int, bytes] = field(default_factory=dict)  # by id
    values: Mapping[str, bytes] = field(default_factory=dict)  # of extensions, by URI; a stage knows the ids
    two_byte: bool = False  # True: extensions are to have the two-byte form
    is_repair: bool = False  # it was sent before
    captured_at: float | None = None  # s of the clock of `now`, of the sample with this timestamp; None: unknown

    @classmethod
    def parse(cls, data: bytes) -> "RtpPacket":
        """Return the packet in `data`. Raises RtpError."""
        if len(data) < HEADER.size or data[0] >> 6 != 2:
            raise RtpError("not an RTP packet")
        flags, kind, sequence_number, timestamp, ssrc = HEADER.unpack_from(data)
        position = HEADER.size + 4 * (flags & 0x0F)
        end = len(data)
        if flags & 0x20:  # padding; its last byte is its length
            end -= data[-1]
            if data[-1] == 0:
                raise RtpError("padding of no length")
        if position > end:
            raise RtpError("an RTP packet that is cut short")
        csrcs = struct.unpack_from(f"!{flags & 0x0F}I", data, HEADER.size)
        extensions: dict[int, bytes] = {}
        if flags & 0x10:
            if position + 4 > end:
                raise RtpError("a header extension that is cut short")
            profile, words = struct.unpack_from("!HH", data, position)
            start, position = position + 4, position + 4 + 4 * words
            if position > end:
                raise RtpError("a header extension that is cut short")
            extensions = parse_extensions(profile, data[start:position])
        payload = data[position:end]
        return cls(kind & 0x7F, sequence_number, timestamp, ssrc, payload, bool(kind & 0x80), csrcs, extensions)

    def pack(self) -> bytes:
        block = pack_extensions(self.extensions, two_byte=self.two_byte) if self.extensions else b""
        flags = 0x80 | (0x10 if block else 0) | len(self.csrcs)
        kind = self.payload_type | (0x80 if self.marker else 0)
        header = HEADER.pack(flags, kind, self.sequence_number, self.timestamp, self.ssrc)
        sources = struct.pack(f"!{len(self.csrcs)}I", *self.csrcs) if self.csrcs else b""
        return header + sources + block + self.payload


def parse_extensions(profile: int, block: bytes) -> dict[int, bytes]:
    """Return the elements of a header extension, by id; none for a profile outside RFC 8285. Raises RtpError."""
    if profile == ONE_BYTE:
        return _parse_elements(block, one_byte=True)
    if profile & 0xFFF0 == TWO_BYTE:
        return _parse_elements(block, one_byte=False)
    return {}  # RFC 3550 5.3.1: another application's extension


def _parse_elements(block: bytes, *, one_byte: bool) -> dict[int, bytes]:
    elements: dict[int, bytes] = {}
    position = 0
    while position < len(block):
        first = block[position]
        if first == 0:
            position += 1
            continue
        if one_byte:
            number, length = first >> 4, (first & 0x0F) + 1
            position += 1
            if number == 15:  # RFC 8285 4.2: nothing behind it is looked at
                break
        else:
            if position + 2 > len(block):
                raise RtpError("a header extension element that is cut short")
            number, length = first, block[position + 1]
            position += 2
        if position + length > len(block):
            raise RtpError("a header extension element that is cut short")
        elements.setdefault(number, block[position : position + length])
        position += length
    elements.pop(0, None)  # one-byte padding with a length; it stands for nothing
    return elements


def pack_extensions(elements: Mapping[int, bytes], *, two_byte: bool = False) -> bytes:
    """Return the header extension with its four-byte header, in the one-byte form unless an element needs the other.

    Raises:
        ValueError: an id that is not 1 to 255, or more than 255 bytes.
    """
    if two_byte or not all(key in ONE_BYTE_IDS and len(value) in ONE_BYTE_LENGTHS for key, value in elements.items()):
        if not all(1 <= key <= 255 and len(value) <= MAX_LENGTH for key, value in elements.items()):
            raise ValueError(f"header extension ids are 1 to 255 and values at most {MAX_LENGTH} bytes")
        profile = TWO_BYTE
        block = b"".join(bytes((key, len(value))) + value for key, value in elements.items())
    else:
        profile = ONE_BYTE
        block = b"".join(bytes((key << 4 | len(value) - 1,)) + value for key, value in elements.items())
    words = (len(block) + 3) // 4
    return struct.pack("!HH", profile, words) + block.ljust(4 * words, b"\x00")
