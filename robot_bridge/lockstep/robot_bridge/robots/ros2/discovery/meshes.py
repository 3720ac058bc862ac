"""Reads a mesh of a URDF as few triangles, where its file is on this machine: STL, binary or text.

The name comes from a topic. So only a regular file with the ending of a mesh is read, up to a bound, and nothing of it
is kept but the numbers of some vertices.
"""

import os
from collections.abc import Mapping
from pathlib import Path
from urllib.parse import unquote, urlsplit

import numpy as np
import numpy.typing as npt

from lockstep.robot_bridge.robots.ros2.discovery.urdf import Mesh

__all__ = ["mesh_file", "read_mesh", "simplified"]

MAX_BYTES = 64 << 20
MOST_EXTENT = 1e6  # in the mesh's units
CELLS = (4096, 64, 48, 36, 27, 20, 15, 12, 10, 8, 7, 6, 5, 4, 3, 2)  # along the longest side, first all but exact
BASE = 8192
HEAD, TRIANGLE = 84, 50  # bytes of a binary STL: head with the count, each triangle
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])

Points = npt.NDArray[np.float64]


def mesh_file(uri: str, environment: Mapping[str, str] = os.environ) -> Path | None:
    """Return the file of "package://NAME/path" or "file:///path"; None if it is not on this machine."""
    parts = urlsplit(uri)
    path = unquote(parts.path)
    if ".." in Path(path).parts or not path.lower().endswith(".stl"):
        return None
    if parts.scheme == "file":
        places = [Path(path)]
    elif parts.scheme == "package":
        prefixes = filter(None, environment.get("AMENT_PREFIX_PATH", "").split(os.pathsep))
        places = [Path(prefix) / "share" / parts.netloc / path.lstrip("/") for prefix in prefixes]
    else:
        return None
    return next((place for place in places if place.is_file()), None)


def read_mesh(uri: str, most: int) -> Mesh | None:
    """Return a mesh as at most so many vertices; None if it cannot be read."""
    try:
        file = mesh_file(uri)
        if file is None or file.stat().st_size > MAX_BYTES:
            return None
        points = _points(file.read_bytes())
    except (OSError, ValueError):
        return None
    if points.size == 0 or len(points) % 3 or not np.isfinite(points).all():
        return None
    return simplified(points, most)


def simplified(corners: Points, most: int) -> Mesh | None:
    """Merge corners that are near each other until there are at most `most`; None if no triangle is left.

    `corners`: of the triangles, three each, n x 3.
    """
    low, extent = corners.min(axis=0), float((corners.max(axis=0) - corners.min(axis=0)).max())
    if not 0 < extent < MOST_EXTENT:
        return None
    for cells in CELLS:
        found = _merged(corners, np.floor((corners - low) * (cells / extent)).astype(np.int64))
        if len(found.vertices) <= most:
            return found if found.triangles else None
    return None


def _merged(corners: Points, cells: npt.NDArray[np.int64]) -> Mesh:
    """Merge the corners in each cell into their mean, and leave out triangles that vanish or come twice."""
    _, numbers, counts = np.unique(cells @ (BASE**2, BASE, 1), return_inverse=True, return_counts=True)
    numbers = numbers.reshape(-1)
    means = np.stack([np.bincount(numbers, corners[:, axis]) for axis in range(3)], axis=1) / counts[:, None]
    triangles: dict[tuple[int, ...], tuple[int, int, int]] = {}
    for a, b, c in numbers.reshape(-1, 3).tolist():
        if a != b and b != c and c != a:
            triangles.setdefault(tuple(sorted((a, b, c))), (a, b, c))
    used = {each: at for at, each in enumerate(sorted({each for found in triangles.values() for each in found}))}
    vertices = [(float(x), float(y), float(z)) for x, y, z in means[list(used)]]
    return Mesh(vertices, [(used[a], used[b], used[c]) for a, b, c in triangles.values()])


def _points(data: bytes) -> Points:
    """Return the corners of all triangles.

    Raises:
        ValueError: the data is no STL.
    """
    count = int.from_bytes(data[80:HEAD], "little")
    if len(data) == HEAD + count * TRIANGLE:  # some binary files begin with "solid" too
        triangles = np.frombuffer(data, _TRIANGLE, count=count, offset=HEAD)
        return triangles["corners"].reshape(-1, 3).astype(np.float64)
    lines = (line.split() for line in data.splitlines())
    return np.array([[float(value) for value in line[1:4]] for line in lines if line[:1] == [b"vertex"]]).reshape(-1, 3)
