"""The map of a robot and its navigation, on the robot link and on the console's channels (docs/robot-link.md, "Maps").

A map is named by a hash of its contents, so an older map is never taken for the newest one.
"""

import hashlib
import zlib
from typing import Annotated

import msgspec

from lockstep.protocol.errors import MessageError
from lockstep.protocol.serial import MAX_EVENT

__all__ = [
    "MAX_CELLS",
    "MAX_COORDINATE",
    "MAX_MAP_BYTES",
    "MAX_PATH_POINTS",
    "MAX_RESOLUTION",
    "OCCUPIED",
    "UNKNOWN",
    "Coordinate",
    "MapId",
    "Navigation",
    "OccupancyMap",
    "PlanarPose",
    "map_cells",
    "map_id",
]

MAX_CELLS = 1 << 20
MAX_SIDE = 4096  # cells
MAX_COORDINATE = 1e6  # m or rad
MAX_RESOLUTION = 1e3  # m
MAX_MAP_BYTES = 32 << 10  # of the compressed cells: half a second at 512 kbit/s, in which no picture comes
MAX_PATH_POINTS = 64
OCCUPIED = 65  # from this value on a cell counts as occupied, as in nav2's map server
UNKNOWN = 255  # value of a cell that the robot knows nothing of

# Letters that nothing has to escape: the id stands in a path.
MapId = Annotated[str, msgspec.Meta(pattern=r"^[0-9a-f]{0,32}(?![\s\S])")]
Side = Annotated[int, msgspec.Meta(ge=1, le=MAX_SIDE)]
Coordinate = Annotated[float, msgspec.Meta(ge=-MAX_COORDINATE, le=MAX_COORDINATE)]  # m or rad
Resolution = Annotated[float, msgspec.Meta(gt=0, le=MAX_RESOLUTION)]
PlanarPose = tuple[Coordinate, Coordinate, Coordinate]  # x (m), y (m), yaw (rad)
Seconds = Annotated[float, msgspec.Meta(ge=0, le=1e9)]


class OccupancyMap(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="map"):
    """A grid that says where the robot can go. Each message replaces the one before it."""

    id: MapId  # of these contents
    width: Side  # cells along x
    height: Side  # cells along y
    resolution: Resolution  # m, the side of a cell
    origin: PlanarPose = (0.0, 0.0, 0.0)  # pose of the outer corner of cell (0, 0) in the map's frame
    # zlib (RFC 1950) of one byte per cell, along x and then along y: 0 (free) to 100 (occupied); 255: not known
    cells: Annotated[bytes, msgspec.Meta(max_length=MAX_MAP_BYTES)]  # b"x\x9c…"


class Navigation(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="navigation"):
    """Where the robot is on its map, and where it is going. Each message replaces the one before it."""

    event: Annotated[int, msgspec.Meta(ge=1, le=MAX_EVENT)]  # the current one when this was said
    map: MapId = ""  # of the newest map; "": none yet
    map_age: Seconds = 0.0  # s since the robot got or made that map, by the bridge's own clock
    located: bool = True  # False: the robot does not know now where it is on the map
    frame: PlanarPose = (0.0, 0.0, 0.0)  # pose, in the map's frame, of the frame of the robot's measured pose
    goal: Annotated[list[Coordinate], msgspec.Meta(max_length=3)] = []  # x, y and yaw in the map's frame; empty: none
    path: Annotated[list[Coordinate], msgspec.Meta(max_length=2 * MAX_PATH_POINTS)] = []  # x and y in turn, from here
    path_age: Seconds = 0.0  # s since the robot planned it


def map_id(width: int, height: int, resolution: float, origin: PlanarPose, cells: bytes) -> str:
    """Return the id of a map with these contents. `cells`: not compressed."""
    shape = msgspec.msgpack.encode((width, height, float(resolution), [float(each) for each in origin]))
    return hashlib.sha256(shape + cells).hexdigest()[:32]


def map_cells(map: OccupancyMap) -> bytes:
    """Return the cells of a map, `width` times `height` bytes.

    Raises:
        MessageError: they are not what the message says.
    """
    size = map.width * map.height
    if size > MAX_CELLS:
        raise MessageError(f"a map of {size} cells, the bound is {MAX_CELLS}")
    inflater = zlib.decompressobj()
    try:
        cells = inflater.decompress(map.cells, size + 1)  # never more memory than that, whatever the sender says
    except zlib.error as error:
        raise MessageError(f"the cells of a map cannot be inflated: {error}") from error
    if len(cells) != size or not inflater.eof:
        raise MessageError(f"a map of {map.width} by {map.height} cells has not {size} of them")
    return cells
