"""Reads a mesh of a URDF as few triangles, where its file is on this machine: STL, COLLADA (.dae) or OBJ.

The name comes from a topic. So only a regular file with the ending of a mesh is read, up to a bound for each and for
all, no file that it names is opened, and nothing of it is kept but the numbers of some vertices.
"""

import io
import os
import warnings
import zipfile
from array import array
from collections.abc import Iterator, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit
from xml.parsers import expat

import numpy as np
import numpy.typing as npt

from lockstep.robot_bridge.robots.ros2.discovery.urdf import Mesh

__all__ = ["MeshReader", "mesh_file", "read_mesh", "simplified"]

MAX_BYTES = {".stl": 64 << 20, ".dae": 16 << 20, ".obj": 64 << 20}  # of a file
MOST_CORNERS = 4_000_000  # of the triangles of an OBJ or COLLADA file
MOST_INSTANCES, MOST_NODES = 500, 10_000  # of a COLLADA file; the latter with all that its instances repeat
MOST_WORK = 1_000_000  # elements in a COLLADA file's libraries of nodes, times its instances
LEAST = 30  # corners that a part of a COLLADA file counts at least, as one of lines, which has none
MOST_LINE = 1 << 16  # bytes
MAX_ALL_BYTES = 512 << 20  # of all meshes of a URDF
MOST_EXTENT = 1e6  # in the mesh's units
HEAD, TRIANGLE = 84, 50  # bytes of a binary STL: head with the count, each triangle
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
CELLS = (4096, 64, 48, 36, 27, 20, 15, 12, 10, 8, 7, 6, 5, 4, 3, 2)  # along the longest side, first all but exact
EXACT_CORNERS = 30_000  # a mesh with more of them has no room for all its vertices: the first grid is left out
DENSE_CELLS = 65**3  # a grid with more of them is numbered by its cells in use

Points = npt.NDArray[Any]  # n x 3, floats of either size
Numbers = npt.NDArray[np.int64]


def mesh_file(uri: str, environment: Mapping[str, str] = os.environ) -> Path | None:
    """Return the file of "package://NAME/path" or "file:///path"; None if it is not on this machine."""
    parts = urlsplit(uri)
    path = unquote(parts.path)
    if ".." in Path(path).parts or Path(path).suffix.lower() not in MAX_BYTES:
        return None
    if parts.scheme == "file":
        places = [Path(path)]
    elif parts.scheme == "package":
        prefixes = filter(None, environment.get("AMENT_PREFIX_PATH", "").split(os.pathsep))
        places = [Path(prefix) / "share" / parts.netloc / path.lstrip("/") for prefix in prefixes]
    else:
        return None
    return next((place for place in places if place.is_file()), None)


class MeshReader:
    """Reads the meshes of one URDF. A mesh that several links have is read once.

    Attributes:
        left_out: the names of those that are too large, or that nothing here reads, with the reason
    """

    def __init__(self) -> None:
        self.left_out: list[str] = []
        self._left = MAX_ALL_BYTES
        self._read: dict[tuple[str, int], Mesh | None] = {}

    def __call__(self, uri: str, most: int) -> Mesh | None:
        """Return a mesh as at most so many vertices; None if it cannot be read, or is too large."""
        if (uri, most) not in self._read:
            self._read[uri, most] = self._within_bounds(uri, most)
        return self._read[uri, most]

    def _within_bounds(self, uri: str, most: int) -> Mesh | None:
        try:
            file = mesh_file(uri)
            size = 0 if file is None else file.stat().st_size
        except (OSError, ValueError):
            return None
        if file is not None and size > (most_bytes := _most_bytes(file)):
            self.left_out.append(f"{uri}: it has more than {most_bytes >> 20} MiB")
        elif size > self._left:
            self.left_out.append(f"{uri}: the meshes have more than {MAX_ALL_BYTES >> 20} MiB together")
        else:
            self._left -= size
            try:
                return read_mesh(uri, most)
            except ImportError:
                self.left_out.append(f"{uri}: install pycollada (Debian: python3-collada) beside ROS to have it drawn")
        return None


def read_mesh(uri: str, most: int) -> Mesh | None:
    """Return a mesh as at most so many vertices; None if it cannot be read.

    Raises:
        ImportError: it is COLLADA, and pycollada is not installed.
    """
    try:
        file = mesh_file(uri)
        if file is None or file.stat().st_size > _most_bytes(file):
            return None
        points = READERS[file.suffix.lower()](file.read_bytes())
    except (OSError, ValueError, OverflowError):
        return None
    if points.size == 0 or len(points) % 3 or not np.isfinite(points).all():
        return None
    return simplified(points, most)


def simplified(corners: Points, most: int) -> Mesh | None:
    """Merge corners that are near each other until there are at most `most`; None if no triangle is left.

    `corners`: of the triangles, three each, n x 3.
    """
    low, high = corners.min(axis=0).astype(np.float64), corners.max(axis=0).astype(np.float64)
    with np.errstate(over="ignore"):
        extent = float((high - low).max())
    if not 0 < extent < MOST_EXTENT:
        return None
    shares = np.empty(corners.shape, np.float32)  # of the longest side
    for axis in range(3):
        shares[:, axis] = (corners[:, axis] - low[axis]) / extent
    for cells in CELLS if len(corners) <= EXACT_CORNERS else CELLS[1:]:
        found = _merged(corners, _cell_numbers(shares, cells), most)
        if found is not None:
            return found if found.triangles else None
    return None


def _cell_numbers(shares: npt.NDArray[np.float32], cells: int) -> Numbers:
    """Return the number of each corner's cell, in a grid of so many along the longest side."""
    numbers = np.zeros(len(shares), np.int64)
    for axis in range(3):
        numbers *= cells + 1  # the farthest corner has a cell of its own
        numbers += (shares[:, axis] * np.float32(cells)).astype(np.int64)
    if (cells + 1) ** 3 > DENSE_CELLS:
        numbers = np.unique(numbers, return_inverse=True)[1].reshape(-1).astype(np.int64)
    return numbers


def _merged(corners: Points, numbers: Numbers, most: int) -> Mesh | None:
    """Merge the corners in each cell into their mean, and leave out triangles that vanish or come twice.

    None: more than `most` vertices are left. `numbers`: of the corners' cells.
    """
    a, b, c = numbers[0::3], numbers[1::3], numbers[2::3]
    triangles = numbers.reshape(-1, 3)[(a != b) & (b != c) & (c != a)]
    used = np.zeros(int(numbers.max()) + 1, np.bool_)
    used[triangles] = True
    count = int(np.count_nonzero(used))
    if count > most:
        return None
    renumbered = (np.cumsum(used) - 1)[triangles]
    ordered = np.sort(renumbered, axis=1)
    _, first = np.unique(ordered @ (count**2, count, 1), return_index=True)
    counts = np.bincount(numbers, minlength=len(used))[used]
    means = [np.bincount(numbers, corners[:, axis], minlength=len(used))[used] / counts for axis in range(3)]
    vertices = [(float(x), float(y), float(z)) for x, y, z in zip(*means, strict=True)]
    return Mesh(vertices, [(int(a), int(b), int(c)) for a, b, c in renumbered[np.sort(first)]])


def _most_bytes(file: Path) -> int:
    return MAX_BYTES[file.suffix.lower()]


def _stl(data: bytes) -> Points:
    """Return the corners of all triangles.

    Raises:
        ValueError: the data is no STL.
    """
    count = int.from_bytes(data[80:HEAD], "little")
    if len(data) == HEAD + count * TRIANGLE:  # some binary files begin with "solid" too
        triangles = np.frombuffer(data, _TRIANGLE, count=count, offset=HEAD)
        return triangles["corners"].reshape(-1, 3)
    return np.fromiter(_text_coordinates(data), np.float64).reshape(-1, 3)


def _lines(data: bytes) -> Iterator[list[bytes]]:
    """Yield the words of each line, one by one: a list of all would be many times as large as the file."""
    for line in io.BytesIO(data):
        if len(line) > MOST_LINE:
            raise ValueError("too long a line")
        yield line.split()


def _text_coordinates(data: bytes) -> Iterator[float]:
    for words in _lines(data):
        if words[:1] == [b"vertex"]:
            x, y, z = map(float, words[1:4])
            yield from (x, y, z)


def _obj(data: bytes) -> Points:
    """Return the corners of all faces, each as a fan of triangles.

    Raises:
        ValueError: the data is no OBJ, or has too many faces.
    """
    places, corners = array("d"), array("q")
    for words in _lines(data):
        if words[:1] == [b"v"]:
            x, y, z = map(float, words[1:4])
            places.extend((x, y, z))
        elif words[:1] == [b"f"]:
            # "7/1/3": corner, texture and normal; from 1 on, or back from the last corner so far
            numbers = [int(word.partition(b"/")[0]) for word in words[1:]]
            first, *others = [number - 1 if number > 0 else len(places) // 3 + number for number in numbers]
            for second, third in pairwise(others):
                corners.extend((first, second, third))
        if len(corners) > MOST_CORNERS:
            raise ValueError("too many faces")
    points, used = np.array(places).reshape(-1, 3), np.array(corners, np.int64)
    if not ((used >= 0) & (used < len(points))).all():
        raise ValueError("a face names a corner that does not exist")
    return points[used]


def _dae(data: bytes) -> Points:
    """Return the corners of all triangles of a COLLADA scene, in meters.

    Its nodes are where it places them. The direction that it calls "up" is left alone, as RViz does.

    Raises:
        ValueError: the data is no COLLADA.
        ImportError: pycollada is not installed.
    """
    import collada

    _check_collada(data)
    try:
        with warnings.catch_warnings(action="ignore"):  # it uses numpy's matrices, which numpy is going to drop
            document = collada.Collada(io.BytesIO(data), ignore=[collada.common.DaeError])
            unit = document.assetInfo.unitmeter or 1.0
            known: dict[int, int] = {}
            if sum(_size(node, known) for node in document.scene.nodes) > MOST_NODES:
                raise ValueError("too many nodes")
            found, left = [], MOST_CORNERS
            for each in document.scene.objects("geometry"):
                for part in each.primitives():
                    found.append(_triangles(part))
                    left -= max(LEAST, len(found[-1]))
                    if left < 0:
                        raise ValueError("too many triangles")
    except Exception as error:  # pycollada tells malformed data by errors of many kinds
        raise ValueError("no COLLADA") from error
    return np.concatenate([np.empty((0, 3)), *found]) * unit


def _check_collada(data: bytes) -> None:
    """Refuse what makes a reader open other files, or work without end, before one reads it.

    Raises:
        ValueError: it is an archive or no XML, defines entities, or has too many instances of nodes.
    """
    if zipfile.is_zipfile(io.BytesIO(data)):
        raise ValueError("an archive")  # which pycollada would unpack
    instances = elements = depth = 0  # elements in libraries of nodes, and how deep in such a library the parser is

    def begin(name: str, _: dict[str, str]) -> None:
        nonlocal instances, elements, depth
        kind = name.rpartition(":")[2]
        instances += kind == "instance_node"
        depth += depth > 0 or kind == "library_nodes"
        elements += depth > 0
        # Texts of an array all take as much room as its longest.
        if instances > MOST_INSTANCES or kind in ("Name_array", "IDREF_array"):
            raise ValueError(f"too many of {kind}")

    def end(_: str) -> None:
        nonlocal depth
        depth -= depth > 0

    def refuse(*_: object) -> None:
        raise ValueError("a document type")

    parser = expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = begin, end
    parser.StartDoctypeDeclHandler = refuse
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        raise ValueError("no XML") from error
    # pycollada tries the nodes of a library again until none is left whose instances it does not know.
    if elements * (instances + 1) > MOST_WORK:
        raise ValueError("too many instances in a library")


def _size(node: Any, known: dict[int, int]) -> int:
    """Return how many nodes and geometries stand below a node, and itself; an instance counts as what it names."""
    meant = getattr(node, "node", node)
    if id(meant) not in known:
        known[id(meant)] = 0  # while it is counted: one that contains itself ends there
        known[id(meant)] = 1 + sum(_size(child, known) for child in getattr(meant, "children", ()))
    return known[id(meant)]


def _triangles(part: Any) -> Points:
    """Return the corners of a part of a COLLADA geometry; none of lines."""
    if hasattr(part, "triangleset"):
        # A number of corners that is not there would take its room all the same.
        if part.original.nvertices != len(part.original.index):
            raise ValueError("polygons with other corners than there are")
        part = part.triangleset()
    numbers = part.vertex_index
    if part.vertex is None or numbers is None or np.ndim(numbers) != 2 or np.shape(numbers)[1] != 3:
        return np.empty((0, 3))
    points: Points = np.asarray(part.vertex)[numbers].reshape(-1, 3)
    return points


READERS = {".stl": _stl, ".obj": _obj, ".dae": _dae}
