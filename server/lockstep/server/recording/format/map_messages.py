"""A robot's map in Foxglove's schemas: the grid, and where the frame of the map is."""

import math
from collections.abc import Iterator

from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.Grid_pb2 import Grid
from foxglove_schemas_protobuf.PackedElementField_pb2 import PackedElementField
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.Vector2_pb2 import Vector2
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.timestamp_pb2 import Timestamp

from lockstep.protocol.description import RobotDescription
from lockstep.protocol.errors import MessageError
from lockstep.protocol.maps import OccupancyMap, PlanarPose, map_cells
from lockstep.server.recording.format.records import MapRecord, NavigationRecord
from lockstep.server.recording.format.robot_frames import WORLD
from lockstep.server.recording.format.topics import MAP, TRANSFORMS
from lockstep.server.recording.writing.writer import Entry

__all__ = ["MAP_FRAME", "in_world", "map_messages"]

MAP_FRAME = "map"
SECOND = 1_000_000_000


def map_messages(description: RobotDescription, record: MapRecord | NavigationRecord, arrived: int) -> Iterator[Entry]:
    """Yield what viewers show of a record; nothing for a robot without a map, or with a body of the map's name."""
    if description.map is None or any(body.name == MAP_FRAME for body in description.bodies):
        return
    stamp = Timestamp(seconds=arrived // SECOND, nanos=arrived % SECOND)
    if isinstance(record, MapRecord):
        try:
            yield Entry(MAP, record.event, arrived, arrived, _grid(record.map, stamp))
        except MessageError:  # its cells are not what it says: the own record is kept as it came
            return
    elif record.located:
        x, y, yaw = in_world(record.frame)
        transform = FrameTransform(
            timestamp=stamp,
            parent_frame_id=WORLD,
            child_frame_id=MAP_FRAME,
            translation=Vector3(x=x, y=y, z=0.0),
            rotation=_turn(yaw),
        )
        data = FrameTransforms(transforms=[transform]).SerializeToString()
        yield Entry(TRANSFORMS, record.event, arrived, arrived, data)


def in_world(frame: PlanarPose) -> PlanarPose:
    """Return the pose of the map's frame in the frame of the robot's measured pose, given the pose of that in it."""
    x, y, yaw = frame
    cos, sin = math.cos(yaw), math.sin(yaw)
    return -cos * x - sin * y, sin * x - cos * y, -yaw


def _grid(map: OccupancyMap, stamp: Timestamp) -> bytes:
    x, y, yaw = map.origin
    return Grid(
        timestamp=stamp,
        frame_id=MAP_FRAME,
        pose=Pose(position=Vector3(x=x, y=y, z=0.0), orientation=_turn(yaw)),
        column_count=map.width,
        cell_size=Vector2(x=map.resolution, y=map.resolution),
        row_stride=map.width,
        cell_stride=1,
        fields=[PackedElementField(name="occupancy", offset=0, type=PackedElementField.UINT8)],
        data=map_cells(map),
    ).SerializeToString()


def _turn(yaw: float) -> Quaternion:
    return Quaternion(w=math.cos(yaw / 2), x=0.0, y=0.0, z=math.sin(yaw / 2))
