"""Messages of the console to the process that decodes published pictures."""

import msgspec

from lockstep.server.media.published.depacketise import PictureCodec
from lockstep.server.util.framed_pipe import FramedPipe

__all__ = ["PICTURES", "Encoded"]

MAX_LENGTH = 2_500_000  # bytes


class Encoded(msgspec.Struct, frozen=True, array_like=True):
    """One picture as it was published."""

    codec: PictureCodec
    time: float | None  # s, start of its capture, on this machine's monotonic clock; None: decode, but do not show
    keyframe: bool
    data: bytes


PICTURES: FramedPipe[Encoded] = FramedPipe(Encoded, MAX_LENGTH)
