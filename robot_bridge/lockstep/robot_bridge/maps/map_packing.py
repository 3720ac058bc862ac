"""Packs a map into a message of a bounded size. Slow for large maps: call it in a thread. Needs numpy."""

import zlib

import numpy as np
import numpy.typing as npt

from lockstep.protocol.maps import (
    MAX_CELLS,
    MAX_COORDINATE,
    MAX_MAP_BYTES,
    MAX_RESOLUTION,
    MAX_SIDE,
    OCCUPIED,
    UNKNOWN,
    OccupancyMap,
    map_id,
)
from lockstep.robot_bridge.robots.navigation import GridMap

__all__ = ["pack_map"]

FULL = 100  # the value of a cell that is surely occupied

Cells = npt.NDArray[np.uint8]


def pack_map(grid: GridMap) -> OccupancyMap:
    """Return the message of a map.

    While the map has too many cells or does not compress well enough, four cells become one of twice the side: occupied
    if one of them is, not known if one of them is not, else the least free. So a coarser map never shows more room.

    Raises:
        ValueError: the cells are not `width` times `height`, or there are none; its place or its scale is out of the
            message's bounds.
    """
    if grid.width < 1 or grid.height < 1 or len(grid.cells) != grid.width * grid.height:
        raise ValueError(f"a map of {grid.width} by {grid.height} cells with {len(grid.cells)} of them")
    if not all(abs(number) <= MAX_COORDINATE for number in grid.origin):
        raise ValueError(f"a map whose origin is {grid.origin}: beyond {MAX_COORDINATE:g} m")
    cells = np.frombuffer(grid.cells, np.uint8).reshape(grid.height, grid.width)
    if ((cells > FULL) & (cells != UNKNOWN)).any():
        cells = np.where(cells > FULL, UNKNOWN, cells).astype(np.uint8)
    resolution = grid.resolution
    while True:
        if not 0.0 < resolution <= MAX_RESOLUTION:
            raise ValueError(f"a map with cells of {resolution:g} m")
        height, width = cells.shape
        if width <= MAX_SIDE and height <= MAX_SIDE and cells.size <= MAX_CELLS:
            plain = cells.tobytes()
            packed = zlib.compress(plain, 6)
            if len(packed) <= MAX_MAP_BYTES:
                id = map_id(width, height, resolution, grid.origin, plain)
                return OccupancyMap(
                    id=id, width=width, height=height, resolution=resolution, origin=grid.origin, cells=packed
                )
        cells, resolution = _halved(cells), 2 * resolution


def _halved(cells: Cells) -> Cells:
    """Return the map with half as many cells along both sides. What is beyond an odd edge counts as not known."""
    height, width = cells.shape
    cells = np.pad(cells, ((0, height % 2), (0, width % 2)), constant_values=UNKNOWN)
    blocks = cells.reshape((height + 1) // 2, 2, (width + 1) // 2, 2)
    is_known = blocks != UNKNOWN
    worst: Cells = np.where(is_known, blocks, 0).max(axis=(1, 3)).astype(np.uint8)
    return np.where((worst < OCCUPIED) & ~is_known.all(axis=(1, 3)), UNKNOWN, worst).astype(np.uint8)
