"""What the console and the process with LiveKit's client say to each other: 4 bytes of length, then MessagePack."""

import struct
from typing import BinaryIO

import msgspec

__all__ = [
    "Ended",
    "Feedback",
    "Join",
    "Joined",
    "Order",
    "Picture",
    "Room",
    "Said",
    "Sound",
    "Track",
    "WantsKeyframe",
    "decode_order",
    "decode_said",
    "encode_message",
    "read_message",
]

MAX_LENGTH = 16_000_000  # bytes
_LENGTH = struct.Struct("!I")


class Track(msgspec.Struct, frozen=True, array_like=True):
    """One medium that is published."""

    name: str
    kind: str  # "video", "audio"
    codec: str  # "H264", "VP8", "opus", "PCMU"
    width: int = 0  # pixels
    height: int = 0
    frame_rate: float = 0.0  # 1/s
    bitrate_bps: int = 0  # at most


class Join(msgspec.Struct, frozen=True, tag="join", array_like=True):
    """The first order."""

    url: str
    token: str
    tracks: list[Track]


class Picture(msgspec.Struct, frozen=True, tag="picture", array_like=True):
    """Encoded, with the trailer behind it."""

    track: int  # index in `Join.tracks`
    keyframe: bool
    time: float  # s, at capture, on any clock
    data: bytes


class Sound(msgspec.Struct, frozen=True, tag="sound", array_like=True):
    """One encoded packet, with the trailer behind it. The newest win."""

    track: int
    time: int  # in the codec's RTP clock, 32 bits
    data: bytes


class Feedback(msgspec.Struct, frozen=True, tag="feedback", array_like=True):
    """For all observers; the newest wins."""

    text: str


class Joined(msgspec.Struct, frozen=True, tag="joined", array_like=True):
    """Every track is published."""


class WantsKeyframe(msgspec.Struct, frozen=True, tag="keyframe", array_like=True):
    """Somebody cannot decode."""

    track: int


class Room(msgspec.Struct, frozen=True, tag="room", array_like=True):
    """How much the path to the server takes, as its client estimates."""

    track: int
    bits_per_second: int


class Ended(msgspec.Struct, frozen=True, tag="ended", array_like=True):
    """Nothing follows. `reason`: "refused", "unreachable", "lost", "failed"."""

    reason: str
    detail: str  # in words, without the token


Order = Join | Picture | Sound | Feedback
Said = Joined | WantsKeyframe | Room | Ended

_orders: msgspec.msgpack.Decoder[Order] = msgspec.msgpack.Decoder(Order)
_said: msgspec.msgpack.Decoder[Said] = msgspec.msgpack.Decoder(Said)
_encoder = msgspec.msgpack.Encoder()


def encode_message(message: Order | Said) -> bytes:
    data = _encoder.encode(message)
    return _LENGTH.pack(len(data)) + data


def decode_order(data: bytes) -> Order:
    """Without its length. Raises msgspec.DecodeError."""
    return _orders.decode(data)


def decode_said(data: bytes) -> Said:
    """Without its length. Raises msgspec.DecodeError."""
    return _said.decode(data)


def read_message(file: BinaryIO) -> bytes | None:
    """The next one without its length; None when the other side has ended, or makes no sense."""
    head = file.read(_LENGTH.size)
    if len(head) < _LENGTH.size:
        return None
    (length,) = _LENGTH.unpack(head)
    if length > MAX_LENGTH:
        return None
    data = file.read(length)
    return data if len(data) == length else None
