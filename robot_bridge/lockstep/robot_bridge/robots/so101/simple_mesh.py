"""Reads an STL file as fewer triangles: without a GPU the half million of the arm's meshes would take too long.

Binary STL: 80 bytes, the number of triangles (uint32), then 50 bytes for each: normal, three corners (float32), uint16.
"""

from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

__all__ = ["SimpleMesh", "read_simple_mesh"]

HEADER: Final = 84  # bytes
TRIANGLE: Final = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
MOST: Final = 1 << 20  # cells in each direction


class SimpleMesh(NamedTuple):
    vertices: npt.NDArray[np.float64]  # m, (n, 3)
    faces: npt.NDArray[np.int32]  # (m, 3), numbers of vertices


def read_simple_mesh(path: Path, cell: float) -> SimpleMesh:
    """Merge the vertices of each cube of `cell` (m) into their mean, and leave out triangles that vanish.

    Raises:
        OSError: the file cannot be read.
        ValueError: it is not binary STL, or larger than a million cells.
    """
    content = path.read_bytes()
    count = int.from_bytes(content[80:HEADER], "little") if len(content) >= HEADER else -1
    if count < 1 or len(content) != HEADER + count * TRIANGLE.itemsize:
        raise ValueError(f"{path} is not a binary STL file")
    corners = np.frombuffer(content, TRIANGLE, count, HEADER)["corners"].reshape(-1, 3).astype(float)
    if not np.isfinite(corners).all():
        raise ValueError(f"{path} has a corner that is not finite")
    cells = np.floor((corners - corners.min(axis=0)) / cell).astype(np.int64)
    if cells.max() >= MOST:
        raise ValueError(f"{path} is larger than {MOST * cell:g} m")
    _, numbers, counts = np.unique(cells @ (MOST**2, MOST, 1), return_inverse=True, return_counts=True)
    vertices = np.stack([np.bincount(numbers, corners[:, axis]) for axis in range(3)], axis=1) / counts[:, None]
    faces = numbers.reshape(-1, 3)
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    _, first = np.unique(np.sort(faces, axis=1) @ (len(vertices) ** 2, len(vertices), 1), return_index=True)
    return SimpleMesh(vertices, faces[np.sort(first)].astype(np.int32))
