"""RTP payloads of encoded frames: H.264 (RFC 6184), VP8 (RFC 7741), one-packet sound. Pure functions."""

import math
from collections.abc import Iterator

__all__ = ["PAYLOAD_MAX", "packetise_h264", "packetise_sound", "packetise_vp8", "split_nal_units"]

PAYLOAD_MAX = 1200  # bytes of RTP payload; leaves room for extensions, SRTP tag and tunnels under a 1500 byte MTU

START_CODE = b"\x00\x00\x01"
NAL_SEI = 6
NAL_ACCESS_UNIT_DELIMITER = 9
STAP_A = 24
FU_A = 28
FU_START = 0x80
FU_END = 0x40


def split_nal_units(stream: bytes) -> Iterator[bytes]:
    """The NAL units of an Annex B byte stream, without start codes."""
    start = stream.find(START_CODE)
    while start != -1:
        start += 3
        end = stream.find(START_CODE, start)
        nal = stream[start:] if end == -1 else stream[start:end].rstrip(b"\x00")
        if nal:
            yield nal
        start = end


def packetise_h264(stream: bytes, trailer: bytes = b"") -> list[bytes]:
    """Payloads of one access unit in packetization-mode 1; `trailer` goes behind its last NAL unit.

    Receivers join fragments by their headers, never by start codes. Supplemental information and delimiters carry
    nothing for a live view and are left out.
    """
    nals = [nal for nal in split_nal_units(stream) if nal[0] & 0x1F not in (NAL_SEI, NAL_ACCESS_UNIT_DELIMITER)]
    if not nals:
        return []
    nals[-1] += trailer
    payloads: list[bytes] = []
    group: list[bytes] = []
    for nal in nals:
        if group and _stap_size([*group, nal]) > PAYLOAD_MAX:
            payloads.append(_aggregate(group))
            group = []
        if len(nal) > PAYLOAD_MAX:
            payloads.extend(_fragment(nal))
        else:
            group.append(nal)
    if group:
        payloads.append(_aggregate(group))
    return payloads


def _stap_size(nals: list[bytes]) -> int:
    return 1 + sum(2 + len(nal) for nal in nals)


def _aggregate(nals: list[bytes]) -> bytes:
    """A single NAL unit packet, or a STAP-A (RFC 6184 5.7.1)."""
    if len(nals) == 1:
        return nals[0]
    importance = max(nal[0] & 0x60 for nal in nals)
    return bytes([importance | STAP_A]) + b"".join(len(nal).to_bytes(2, "big") + nal for nal in nals)


def _fragment(nal: bytes) -> Iterator[bytes]:
    """FU-A packets of nearly equal size (RFC 6184 5.8)."""
    indicator, kind = nal[0] & 0xE0 | FU_A, nal[0] & 0x1F
    body = memoryview(nal)[1:]
    count = math.ceil(len(body) / (PAYLOAD_MAX - 2))
    size = math.ceil(len(body) / count)
    for offset in range(0, len(body), size):
        flags = (FU_START if offset == 0 else 0) | (FU_END if offset + size >= len(body) else 0)
        yield bytes((indicator, flags | kind)) + body[offset : offset + size]


def packetise_vp8(frame: bytes, trailer: bytes = b"") -> list[bytes]:
    """Payloads of one VP8 frame (RFC 7741 4.2), without a picture id.

    A browser assumes that a picture builds on the one with the preceding id. Payloads are shared by peers that come
    from different tiers; no numbering would be without gaps for all of them, and sequence numbers are.
    """
    first, rest = b"\x10", b"\x00"
    data = memoryview(frame + trailer)
    room = PAYLOAD_MAX - len(first)
    size = math.ceil(len(data) / math.ceil(len(data) / room)) if data else 1
    return [(rest if offset else first) + data[offset : offset + size] for offset in range(0, len(data), size)]


def packetise_sound(packet: bytes, trailer: bytes = b"") -> list[bytes]:
    """Opus (RFC 7587 4.2) and PCMU (RFC 3551 4.5.14): one packet, one payload."""
    return [packet + trailer]
