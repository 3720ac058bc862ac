"""Blurs the planes of a picture by several degrees, for views out of focus."""

import math
from typing import Final

import numpy as np
import numpy.typing as npt

__all__ = ["SIGMAS", "BlurredPlanes", "blurred"]

Plane = npt.NDArray[np.float32]

SIGMAS: Final = (0.0, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0)  # pixels
PASSES: Final = 3  # of a box filter, which together look like a Gaussian


class BlurredPlanes:
    """Planes blurred in advance by every degree of SIGMAS; degrees in between are mixed."""

    def __init__(self, planes: dict[str, Plane]) -> None:
        self._degrees = [{name: blurred(plane, sigma) for name, plane in planes.items()} for sigma in SIGMAS]

    def at(self, sigma: float, part: tuple[slice, slice]) -> dict[str, Plane]:
        """Return a part of the planes, blurred by about `sigma` pixels of the picture."""
        if sigma <= SIGMAS[1]:
            low, share = 0, max(0.0, sigma / SIGMAS[1])
        else:
            exponent = min(math.log2(sigma), len(SIGMAS) - 2.0)
            low = min(int(exponent) + 1, len(SIGMAS) - 2)
            share = exponent + 1 - low
        below = {name: plane[part] for name, plane in self._degrees[low].items()}
        if share == 0.0:
            return below
        above = self._degrees[low + 1]
        weight = np.float32(share)
        return {name: plane + (above[name][part] - plane) * weight for name, plane in below.items()}


def blurred(plane: Plane, sigma: float) -> Plane:
    """Blur by about a Gaussian of `sigma` pixels; beyond an edge the edge's pixels repeat."""
    if sigma <= 0.0:
        return plane
    # n boxes of width w have the variance n (w² - 1) / 12.
    width = max(1, round(math.sqrt(12.0 * sigma * sigma / PASSES + 1.0)) // 2 * 2 + 1)
    for _ in range(PASSES):
        plane = _boxed(_boxed(plane, width).T, width).T
    return np.ascontiguousarray(plane)


def _boxed(plane: Plane, width: int) -> Plane:
    half = width // 2
    padded = np.pad(plane, ((0, 0), (half + 1, half)), mode="edge")
    sums = np.cumsum(padded, axis=1, dtype=np.float64)
    means: Plane = ((sums[:, width:] - sums[:, :-width]) / width).astype(np.float32)
    return means
