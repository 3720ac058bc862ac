"""Joins the RTP payloads of all packets of a picture into an encoded picture. Pure functions."""

from collections.abc import Sequence
from typing import Literal

from lockstep.rtc.rtp.wire.payloads import PayloadError, h264_parts, vp8_part
from lockstep.server.media.codecs.h264 import START_CODE

__all__ = ["PictureCodec", "begins_picture", "is_keyframe", "join_payloads"]

PictureCodec = Literal["H264", "VP8"]

NAL_TYPE = 0x1F
NAL_IDR, NAL_SPS, NAL_DELIMITER = 5, 7, 9


def join_payloads(codec: PictureCodec, payloads: Sequence[bytes]) -> bytes:
    """Join the payloads of all packets of a picture, in order; H.264 becomes a byte stream with start codes.

    Raises:
        PayloadError: a payload is not of this codec, or the picture does not begin with the first.
    """
    parts: list[bytes] = []
    for number, payload in enumerate(payloads):
        if codec == "VP8":
            part = vp8_part(payload)
            if part.begins_frame != (number == 0):
                raise PayloadError("a picture that does not begin with its first packet")
            parts.append(part.data)
            continue
        for unit in h264_parts(payload):
            if unit.begins_unit:
                parts.append(START_CODE)
            elif not parts:
                raise PayloadError("the picture begins in the middle of a fragmented NAL unit")
            parts.append(unit.data)
    return b"".join(parts)


def begins_picture(codec: PictureCodec, payload: bytes) -> bool:
    """True if a picture certainly begins with this packet, whatever came before it.

    In H.264 only a delimiter or a parameter set proves it: pictures may consist of several slices.
    """
    try:
        if codec == "VP8":
            return vp8_part(payload).begins_frame
        parts = list(h264_parts(payload))
    except PayloadError:
        return False
    first = next((part.data for part in parts if part.begins_unit), b"\x00")
    return first[0] & NAL_TYPE in (NAL_SPS, NAL_DELIMITER)


def is_keyframe(codec: PictureCodec, picture: bytes) -> bool:
    """True if decoding can begin with `picture`; in H.264 that takes its parameter sets, too."""
    if codec == "VP8":
        return bool(picture) and not picture[0] & 0x01  # RFC 6386 9.1
    kinds = {nal[0] & NAL_TYPE for nal in picture.split(START_CODE) if nal}
    return NAL_IDR in kinds and NAL_SPS in kinds
