"""Encoded pictures out of RTP payloads: H.264 (RFC 6184) and VP8 (RFC 7741). Pure functions."""

from collections.abc import Iterator, Sequence
from typing import Literal

from server.media.h264 import START_CODE
from server.media.published.errors import BadPayload

__all__ = ["PictureCodec", "begins_picture", "is_keyframe", "join_payloads"]

PictureCodec = Literal["H264", "VP8"]

NAL_TYPE = 0x1F
NAL_IDR, NAL_SPS, NAL_DELIMITER = 5, 7, 9
STAP_A, FU_A = 24, 28
FU_START = 0x80


def join_payloads(codec: PictureCodec, payloads: Sequence[bytes]) -> bytes:
    """The picture in the payloads of all its packets, in their order; H.264 as a byte stream with start codes.

    Raises:
        BadPayload: one of them is none of this codec, or the picture does not begin with the first.
    """
    if codec == "VP8":
        return b"".join(_vp8_part(payload, first=number == 0) for number, payload in enumerate(payloads))
    parts: list[bytes] = []
    for payload in payloads:
        for nal, whole in _nal_parts(payload):
            if whole:
                parts.append(START_CODE)
            elif not parts:
                raise BadPayload("it begins in the middle of a fragmented NAL unit")
            parts.append(nal)
    return b"".join(parts)


def begins_picture(codec: PictureCodec, payload: bytes) -> bool:
    """Whether a picture certainly begins with this packet, whatever came before it.

    Of H.264 only a delimiter or a parameter set says so: pictures may consist of several slices.
    """
    try:
        if codec == "VP8":
            return _vp8_starts(payload)
        nals = [nal for nal, whole in _nal_parts(payload) if whole]
    except BadPayload:
        return False
    return bool(nals) and nals[0][0] & NAL_TYPE in (NAL_SPS, NAL_DELIMITER)


def is_keyframe(codec: PictureCodec, picture: bytes) -> bool:
    """Whether decoding can begin with it. Of H.264 that takes its parameter sets, too."""
    if codec == "VP8":
        return bool(picture) and not picture[0] & 0x01  # RFC 6386 9.1
    kinds = {nal[0] & NAL_TYPE for nal in picture.split(START_CODE) if nal}
    return NAL_IDR in kinds and NAL_SPS in kinds


def _nal_parts(payload: bytes) -> Iterator[tuple[bytes, bool]]:
    """NAL units, or the parts of one; whether each is the beginning of one."""
    if len(payload) < 2:
        raise BadPayload("too short")
    kind = payload[0] & NAL_TYPE
    if 1 <= kind < STAP_A:
        yield payload, True
    elif kind == STAP_A:
        yield from _aggregated(payload)
    elif kind == FU_A:
        if payload[1] & FU_START:
            yield bytes([payload[0] & 0xE0 | payload[1] & NAL_TYPE]) + payload[2:], True
        else:
            yield payload[2:], False
    else:
        raise BadPayload(f"packets of kind {kind} belong to no packetization mode that was answered")


def _aggregated(payload: bytes) -> Iterator[tuple[bytes, bool]]:
    at = 1
    while at < len(payload):
        size = int.from_bytes(payload[at : at + 2], "big")
        nal = payload[at + 2 : at + 2 + size]
        if not nal or len(nal) < size:
            raise BadPayload("an aggregated NAL unit that is cut off")
        yield nal, True
        at += 2 + size


def _vp8_starts(payload: bytes) -> bool:
    return bool(payload) and payload[0] & 0x17 == 0x10  # S bit, partition 0


def _vp8_part(payload: bytes, *, first: bool) -> bytes:
    """Without its descriptor (RFC 7741 4.2)."""
    if not payload:
        raise BadPayload("too short")
    if first != _vp8_starts(payload):
        raise BadPayload("a picture that does not begin with its first packet")
    at = 1
    if payload[0] & 0x80:
        more = payload[1] if len(payload) > 1 else 0
        at = 2
        if more & 0x80:  # PictureID, of 7 or 15 bits
            at += 2 if len(payload) > at and payload[at] & 0x80 else 1
        at += bool(more & 0x40)  # TL0PICIDX
        at += bool(more & 0x30)  # TID, KEYIDX
    if len(payload) <= at:
        raise BadPayload("a VP8 descriptor with nothing behind it")
    return payload[at:]
