"""Messages of a source's process to the console: 4 bytes of length, then MessagePack, on its standard output."""

import struct
from typing import BinaryIO, Literal

import msgspec

__all__ = ["Captured", "Said", "SourceState", "Trouble", "Working", "decode_said", "read_said", "write_said"]

MAX_LENGTH = 16_000_000  # bytes: a picture of 8 million pixels
_LENGTH = struct.Struct("!I")

SourceState = Literal["waiting", "connecting", "live", "reconnecting"]
Codec = Literal["yuv420p", "mjpeg", "h264", "pcm_s16le"]


class Captured(msgspec.Struct, frozen=True, tag="captured", array_like=True):
    """A picture or a segment of sound."""

    codec: Codec
    time: float  # s, start of its capture, on this machine's monotonic clock
    payload: bytes
    width: int = 0  # pixels
    height: int = 0
    sample_rate: int = 0  # Hz
    channels: int = 0
    keyframe: bool = True


class Working(msgspec.Struct, frozen=True, tag="working", array_like=True):
    """The source was opened; `detail` describes its media, in words without its address."""

    detail: str


class Trouble(msgspec.Struct, frozen=True, tag="trouble", array_like=True):
    """The source failed and is tried again."""

    reason: str  # stable, to be counted
    detail: str  # in words without its address


Said = Captured | Working | Trouble

_decoder: msgspec.msgpack.Decoder[Said] = msgspec.msgpack.Decoder(Said)
_encoder = msgspec.msgpack.Encoder()


def write_said(file: BinaryIO, said: Said) -> None:
    data = _encoder.encode(said)
    file.write(_LENGTH.pack(len(data)))
    file.write(data)
    file.flush()


def read_said(file: BinaryIO) -> Said | None:
    """Read the next message; None when the other side has ended, or the message is not valid."""
    head = file.read(_LENGTH.size)
    if len(head) < _LENGTH.size:
        return None
    (length,) = _LENGTH.unpack(head)
    if length > MAX_LENGTH:
        return None
    data = file.read(length)
    if len(data) < length:
        return None
    return decode_said(data)


def decode_said(data: bytes) -> Said | None:
    """Decode one message without its length; None when it is not valid."""
    try:
        return _decoder.decode(data)
    except msgspec.DecodeError:
        return None
