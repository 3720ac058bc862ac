"""Messages of a source's process to the console, on its standard output."""

from typing import Literal

import msgspec

from lockstep.server.util.framed_pipe import FramedPipe

__all__ = ["SAID", "Captured", "Said", "SourceState", "Trouble", "Working"]

MAX_LENGTH = 16_000_000  # bytes: a picture of 8 million pixels

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

SAID: FramedPipe[Said] = FramedPipe(Said, MAX_LENGTH)
