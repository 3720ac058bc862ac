"""How the event reference travels with media (docs/architecture.md, "Carriers"). Bytes only, no RTP stack.

Three carriers; the peer's offer decides which it gets:

- native: header extension (RFC 8285), 4 bytes, big-endian reference
- capture-time: the abs-capture-time header extension, 16 bytes, the reference as whole seconds of the
  estimated capture clock offset
- trailer: behind the encoded frame, in LiveKit's published frame-metadata layout
"""

import struct
from typing import Literal, NamedTuple

from lockstep.protocol.serial import is_event

__all__ = [
    "CAPTURE_TIME_URI",
    "EVENT_REFERENCE_URI",
    "PLAYOUT_DELAY_URI",
    "TRAILER_LENGTH",
    "Carrier",
    "Trailer",
    "append_trailer",
    "pack_capture_time",
    "pack_event_reference",
    "pack_playout_delay",
    "split_trailer",
    "unpack_capture_moment",
    "unpack_capture_time",
    "unpack_event_reference",
]

EVENT_REFERENCE_URI = "urn:x-lockstep:rtp-hdrext:event-reference"
CAPTURE_TIME_URI = "http://www.webrtc.org/experiments/rtp-hdrext/abs-capture-time"
PLAYOUT_DELAY_URI = "http://www.webrtc.org/experiments/rtp-hdrext/playout-delay"

Carrier = Literal["native", "capture-time", "trailer", "none"]

NTP_EPOCH_OFFSET = 2_208_988_800  # s from 1900 to 1970
MAGIC = b"LKTS"
TAG_CAPTURE_TIME = 0x01
TAG_FRAME_ID = 0x02
TRAILER_LENGTH = 2 + 8 + 2 + 4 + 1 + len(MAGIC)  # bytes


class Trailer(NamedTuple):
    """What a trailer said. `event` is None when it carries no valid reference."""

    event: int | None
    capture_time_us: int | None


def pack_event_reference(event: int) -> bytes:
    return struct.pack("!I", event)


def unpack_event_reference(value: bytes) -> int | None:
    """The reference, or None when `value` is not one."""
    if len(value) != 4:
        return None
    event = int.from_bytes(value, "big")
    return event if is_event(event) else None


def pack_capture_time(event: int, capture_time: float) -> bytes:
    """`capture_time`: s since 1970. NTP 64-bit time, then the signed Q32.32 offset."""
    ntp = round((capture_time + NTP_EPOCH_OFFSET) * 2**32) & 0xFFFF_FFFF_FFFF_FFFF
    return struct.pack("!Qq", ntp, event << 32)


def unpack_capture_time(value: bytes) -> int | None:
    """The reference, or None when the offset is absent or is not a whole, valid reference."""
    if len(value) != 16:
        return None
    offset = int.from_bytes(value[8:], "big", signed=True)
    event = offset >> 32
    return event if offset & 0xFFFF_FFFF == 0 and is_event(event) else None


def unpack_capture_moment(value: bytes) -> float | None:
    """When the medium was captured, s since 1970 on the sender's clock; None when `value` is no capture time."""
    if len(value) != 16:
        return None
    return int.from_bytes(value[:8], "big") / 2**32 - NTP_EPOCH_OFFSET


def pack_playout_delay(minimum_ms: int = 0, maximum_ms: int = 0) -> bytes:
    """12 bits each, in units of 10 ms (0 to 40950 ms)."""
    return ((minimum_ms // 10 << 12) | maximum_ms // 10).to_bytes(3, "big")


def append_trailer(payload: bytes, event: int, capture_time_us: int) -> bytes:
    """`payload` with the trailer behind it. TLV bytes and the length are XORed with 0xFF."""
    tlvs = struct.pack("!BBQBBI", TAG_CAPTURE_TIME, 8, capture_time_us, TAG_FRAME_ID, 4, event)
    return payload + bytes(byte ^ 0xFF for byte in tlvs) + bytes([TRAILER_LENGTH ^ 0xFF]) + MAGIC


def split_trailer(data: bytes) -> tuple[bytes, Trailer | None]:
    """The payload and what its trailer says, or (data, None) without a well-formed one. Unknown tags are skipped."""
    if len(data) < len(MAGIC) + 1 or data[-4:] != MAGIC:
        return data, None
    length = data[-5] ^ 0xFF
    if not len(MAGIC) + 1 <= length <= len(data):
        return data, None
    tlvs = bytes(byte ^ 0xFF for byte in data[-length:-5])
    trailer = _read_tlvs(tlvs)
    return (data, None) if trailer is None else (data[:-length], trailer)


def _read_tlvs(tlvs: bytes) -> Trailer | None:
    event: int | None = None
    capture_time_us: int | None = None
    position = 0
    while position < len(tlvs):
        if position + 2 > len(tlvs):
            return None
        tag, size = tlvs[position], tlvs[position + 1]
        value = tlvs[position + 2 : position + 2 + size]
        if len(value) != size:
            return None
        if tag == TAG_FRAME_ID:
            event = unpack_event_reference(value)
        elif tag == TAG_CAPTURE_TIME and size == 8:
            capture_time_us = int.from_bytes(value, "big")
        position += 2 + size
    return Trailer(event, capture_time_us)
