"""Finds the part of a picture in the payload of an RTP packet: VP8 (RFC 7741) and H.264 (RFC 6184). Pure functions."""

from collections.abc import Iterator
from typing import NamedTuple

__all__ = ["H264Part", "PayloadError", "Vp8Part", "h264_parts", "vp8_part"]

NAL_TYPE = 0x1F
STAP_A, FU_A = 24, 28
FU_START = 0x80


class PayloadError(ValueError):
    """A payload that is invalid for its codec."""


class Vp8Part(NamedTuple):
    data: bytes  # without the descriptor
    begins_frame: bool


class H264Part(NamedTuple):
    data: bytes
    begins_unit: bool  # True: a NAL unit begins with it; False: it continues one


def vp8_part(payload: bytes) -> Vp8Part:
    """Return the part in a VP8 payload (RFC 7741 4.2). Raises PayloadError."""
    position = 1
    if payload and payload[0] & 0x80:
        more = payload[1] if len(payload) > 1 else 0
        position = 2
        if more & 0x80:  # PictureID, of 7 or 15 bits
            position += 2 if len(payload) > position and payload[position] & 0x80 else 1
        position += bool(more & 0x40)  # TL0PICIDX
        position += bool(more & 0x30)  # TID, Y and KEYIDX
    if len(payload) <= position:
        raise PayloadError("a VP8 descriptor with nothing behind it")
    return Vp8Part(payload[position:], payload[0] & 0x17 == 0x10)  # S, and partition 0


def h264_parts(payload: bytes) -> Iterator[H264Part]:
    """Yield the NAL units in an H.264 payload, or the part of one. Raises PayloadError."""
    if len(payload) < 2:
        raise PayloadError("too short for H.264")
    kind = payload[0] & NAL_TYPE
    if 1 <= kind < STAP_A:
        yield H264Part(payload, begins_unit=True)
    elif kind == STAP_A:
        yield from _aggregated(payload)
    elif kind == FU_A and payload[1] & FU_START:
        yield H264Part(bytes([payload[0] & 0xE0 | payload[1] & NAL_TYPE]) + payload[2:], begins_unit=True)
    elif kind == FU_A:
        yield H264Part(payload[2:], begins_unit=False)
    else:
        raise PayloadError(f"packets of kind {kind} belong to no packetization mode that is negotiated here")


def _aggregated(payload: bytes) -> Iterator[H264Part]:
    """Yield the NAL units of an aggregation packet (RFC 6184 5.7.1)."""
    position = 1
    while position < len(payload):
        size = int.from_bytes(payload[position : position + 2], "big")
        unit = payload[position + 2 : position + 2 + size]
        if not unit or len(unit) < size:
            raise PayloadError("an aggregated unit that is cut off")
        yield H264Part(unit, begins_unit=True)
        position += 2 + size
