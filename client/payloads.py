"""What an RTP payload holds of a frame: VP8 (RFC 7741), H.264 (RFC 6184), and sound, which is as it is. No I/O."""

from collections.abc import Callable, Mapping

__all__ = ["UNPACK", "PayloadError"]

START_CODE = b"\x00\x00\x00\x01"
NAL_TYPE = 0x1F
STAP_A, FU_A = 24, 28
FU_START = 0x80


class PayloadError(ValueError):
    """A payload that is none of its codec."""


def unpack_vp8(payload: bytes) -> bytes:
    """Without its descriptor (RFC 7741 4.2). Raises PayloadError."""
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
    return payload[position:]


def unpack_h264(payload: bytes) -> bytes:
    """As part of a byte stream with start codes. Raises PayloadError."""
    if len(payload) < 2:
        raise PayloadError("too short for H.264")
    kind = payload[0] & NAL_TYPE
    if 1 <= kind < STAP_A:
        return START_CODE + payload
    if kind == STAP_A:
        return _unpack_aggregated(payload)
    if kind == FU_A:
        head = START_CODE + bytes([payload[0] & 0xE0 | payload[1] & NAL_TYPE]) if payload[1] & FU_START else b""
        return head + payload[2:]
    raise PayloadError(f"a packet of kind {kind}, which no packetization mode of ours has")


def _unpack_aggregated(payload: bytes) -> bytes:
    """RFC 6184 5.7.1."""
    parts: list[bytes] = []
    position = 1
    while position < len(payload):
        size = int.from_bytes(payload[position : position + 2], "big")
        unit = payload[position + 2 : position + 2 + size]
        if not unit or len(unit) < size:
            raise PayloadError("an aggregated unit that is cut off")
        parts += [START_CODE, unit]
        position += 2 + size
    return b"".join(parts)


def _as_it_is(payload: bytes) -> bytes:
    return payload


UNPACK: Mapping[str, Callable[[bytes], bytes]] = {
    "VP8": unpack_vp8,
    "H264": unpack_h264,
    "opus": _as_it_is,
    "PCMU": _as_it_is,
}  # by name in SDP
