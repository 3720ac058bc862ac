"""Shares one peer's bitrate out among its cameras. No I/O."""

from collections.abc import Sequence
from typing import NamedTuple

__all__ = ["CameraNeed", "share_out"]

FLOOR_BPS = 30_000  # per camera: enough for small, continuous pictures
LEAST_BPS = 10_000  # per other camera when there is hardly enough for the main one


class CameraNeed(NamedTuple):
    pixels_per_second: float  # at its full size and rate
    maximum_bps: float


def share_out(total_bps: float, cameras: Sequence[CameraNeed]) -> list[float]:
    """Return the bits per second of each camera; the first is the main one.

    The main camera's floor comes first, then the others' floors. The rest is shared by pixels per second, and the part
    that a camera cannot use goes to the main camera.
    """
    if not cameras:
        return []
    main = min(total_bps, FLOOR_BPS)
    left = total_bps - main
    floors = [main] + [min(FLOOR_BPS, max(LEAST_BPS, left / max(1, len(cameras) - 1)))] * (len(cameras) - 1)
    left = max(0.0, total_bps - sum(floors))
    weights = sum(camera.pixels_per_second for camera in cameras) or 1.0
    shares = [
        min(camera.maximum_bps, floor + left * camera.pixels_per_second / weights)
        for camera, floor in zip(cameras, floors, strict=True)
    ]
    unused = max(0.0, total_bps - sum(shares))
    shares[0] = min(max(cameras[0].maximum_bps, FLOOR_BPS), shares[0] + unused)
    for i in range(1, len(shares)):  # beyond the main camera's maximum, to the others
        unused = max(0.0, total_bps - sum(shares))
        shares[i] = min(cameras[i].maximum_bps, shares[i] + unused)
    return shares
