"""Messages of the console to the process that decodes published pictures: 4 bytes of length, then MessagePack."""

import struct
from typing import BinaryIO

import msgspec

from lockstep.server.media.published.depacketise import PictureCodec

__all__ = ["Encoded", "encode_picture", "read_picture"]

MAX_LENGTH = 2_500_000  # bytes
_LENGTH = struct.Struct("!I")


class Encoded(msgspec.Struct, frozen=True, array_like=True):
    """One picture as it was published."""

    codec: PictureCodec
    time: float | None  # s, start of its capture, on this machine's monotonic clock; None: decode, but do not show
    keyframe: bool
    data: bytes


_decoder = msgspec.msgpack.Decoder(Encoded)
_encoder = msgspec.msgpack.Encoder()


def encode_picture(picture: Encoded) -> bytes:
    data = _encoder.encode(picture)
    return _LENGTH.pack(len(data)) + data


def read_picture(file: BinaryIO) -> Encoded | None:
    """Read the next picture; None when the console has gone, or the message is not valid."""
    head = file.read(_LENGTH.size)
    if len(head) < _LENGTH.size:
        return None
    (length,) = _LENGTH.unpack(head)
    data = file.read(length) if length <= MAX_LENGTH else b""
    try:
        return _decoder.decode(data)
    except msgspec.DecodeError:
        return None
