"""Unpacks RTP payloads into the parts of a frame that decoders take. No I/O."""

from collections.abc import Callable, Mapping

from lockstep.rtc.rtp.wire.payloads import h264_parts, vp8_part

__all__ = ["UNPACK"]

START_CODE = b"\x00\x00\x00\x01"


def unpack_vp8(payload: bytes) -> bytes:
    """Return the part of a VP8 frame in `payload`. Raises PayloadError."""
    return vp8_part(payload).data


def unpack_h264(payload: bytes) -> bytes:
    """Return the part of an H.264 frame in `payload`, as a byte stream with start codes. Raises PayloadError."""
    return b"".join(START_CODE + part.data if part.begins_unit else part.data for part in h264_parts(payload))


def _as_it_is(payload: bytes) -> bytes:
    return payload


UNPACK: Mapping[str, Callable[[bytes], bytes]] = {
    "VP8": unpack_vp8,
    "H264": unpack_h264,
    "opus": _as_it_is,
    "PCMU": _as_it_is,
}  # by name in SDP
