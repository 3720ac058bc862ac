"""Finds the box around a mesh of a URDF, where its file is on this machine: STL, binary or text.

The name comes from a topic. So only a regular file with the ending of a mesh is read, up to a bound, and nothing of it
is kept but six numbers.
"""

import os
from collections.abc import Mapping
from pathlib import Path
from urllib.parse import unquote, urlsplit

import numpy as np
import numpy.typing as npt

from lockstep.robot_bridge.robots.ros2.discovery.urdf import Box

__all__ = ["mesh_box", "mesh_file"]

MAX_BYTES = 64 << 20
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


def mesh_box(uri: str) -> Box | None:
    """Return the box around a mesh, in the mesh's own units; None if it cannot be read."""
    try:
        file = mesh_file(uri)
        if file is None or file.stat().st_size > MAX_BYTES:
            return None
        points = _points(file.read_bytes())
    except (OSError, ValueError):
        return None
    if points.size == 0 or not np.isfinite(points).all():
        return None
    low, high = points.min(axis=0), points.max(axis=0)
    centre, half = (low + high) / 2, (high - low) / 2
    return Box((float(centre[0]), float(centre[1]), float(centre[2])), (float(half[0]), float(half[1]), float(half[2])))


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
