"""RTP headers (RFC 3550 5.1) and their extensions (RFC 8285). Bytes only, no I/O."""

from typing import NamedTuple

__all__ = ["RtpHeader", "find_extension", "parse_rtp_header"]

FIXED = 12  # bytes
ONE_BYTE = 0xBEDE
TWO_BYTE = 0x1000


class RtpHeader(NamedTuple):
    payload_type: int
    marker: bool
    sequence: int
    timestamp: int
    ssrc: int
    profile: int  # of the extension; 0 without one
    extension: bytes


def parse_rtp_header(data: bytes) -> RtpHeader | None:
    """Return the header, or None if `data` is not an RTP packet."""
    if len(data) < FIXED or data[0] >> 6 != 2:
        return None
    position = FIXED + 4 * (data[0] & 0x0F)
    profile, extension = 0, b""
    if data[0] & 0x10:
        if len(data) < position + 4:
            return None
        profile = int.from_bytes(data[position : position + 2], "big")
        length = 4 * int.from_bytes(data[position + 2 : position + 4], "big")
        extension = data[position + 4 : position + 4 + length]
        if len(extension) != length:
            return None
    return RtpHeader(
        payload_type=data[1] & 0x7F,
        marker=bool(data[1] & 0x80),
        sequence=int.from_bytes(data[2:4], "big"),
        timestamp=int.from_bytes(data[4:8], "big"),
        ssrc=int.from_bytes(data[8:12], "big"),
        profile=profile,
        extension=extension,
    )


def find_extension(profile: int, extension: bytes, wanted: int) -> bytes | None:
    """Return the element with id `wanted`, or None if it is missing or the elements are cut short."""
    if profile != ONE_BYTE and profile & 0xFFF0 != TWO_BYTE:
        return None
    header = 1 if profile == ONE_BYTE else 2
    position = 0
    while position + header <= len(extension):
        first = extension[position]
        if first == 0:  # padding
            position += 1
            continue
        number, length = (first >> 4, (first & 0x0F) + 1) if header == 1 else (first, extension[position + 1])
        value = extension[position + header : position + header + length]
        if len(value) != length:
            return None
        if number == wanted:
            return value
        position += header + length
    return None
