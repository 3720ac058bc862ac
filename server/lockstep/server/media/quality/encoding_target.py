"""The encoding of one camera's pictures for one tier."""

from typing import Literal, NamedTuple

from lockstep.protocol.console import Tier

__all__ = ["EncodingTarget", "PictureTier", "scaled_size"]

PictureTier = Tier | Literal["crowd"]  # tiers of encoders: "crowd" is the high tier with fewer pictures

MIN_SIDE = 16  # pixels


class EncodingTarget(NamedTuple):
    """The bitrate, frame rate and scale that a tier's encoder aims at."""

    bitrate_bps: int
    frame_rate: float  # per second; at most the camera's
    scale: float = 1.0  # of both sides

    def thinned(self, divisor: int) -> "EncodingTarget":
        """Return the target for one picture of `divisor`, each with as many bits as before."""
        return self._replace(bitrate_bps=self.bitrate_bps // divisor, frame_rate=self.frame_rate / divisor)

    def size(self, width: int, height: int) -> tuple[int, int]:
        """Return the encoded size of a picture of `width` x `height`."""
        return scaled_size(width, height, self.scale)


def scaled_size(width: int, height: int, scale: float) -> tuple[int, int]:
    """Scale both sides to even numbers, as 4:2:0 needs them; the aspect ratio stays within a pixel."""
    if scale >= 1.0:
        return width, height
    return max(MIN_SIDE, round(width * scale / 2) * 2), max(MIN_SIDE, round(height * scale / 2) * 2)
