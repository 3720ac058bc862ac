"""How the pictures of one camera are encoded for one tier."""

from typing import Literal, NamedTuple

from lockstep.protocol.console import Tier

__all__ = ["EncodingTarget", "PictureTier", "scaled_size"]

PictureTier = Tier | Literal["crowd"]  # what is encoded: "crowd" is the high tier with fewer pictures

MIN_SIDE = 16  # pixels


class EncodingTarget(NamedTuple):
    """What a tier's encoder is to make of a camera's pictures."""

    bitrate_bps: int
    frame_rate: float  # per second; at most the camera's
    scale: float = 1.0  # of both sides

    def thinned(self, divisor: int) -> "EncodingTarget":
        """One of so many pictures, each with as many bits as before."""
        return self._replace(bitrate_bps=self.bitrate_bps // divisor, frame_rate=self.frame_rate / divisor)

    def size(self, width: int, height: int) -> tuple[int, int]:
        """The size that a picture of `width` x `height` gets."""
        return scaled_size(width, height, self.scale)


def scaled_size(width: int, height: int, scale: float) -> tuple[int, int]:
    """Both sides times `scale`, even as 4:2:0 needs them; the aspect ratio stays within a pixel."""
    if scale >= 1.0:
        return width, height
    return max(MIN_SIDE, round(width * scale / 2) * 2), max(MIN_SIDE, round(height * scale / 2) * 2)
