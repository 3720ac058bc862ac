"""Maps of a recording in Foxglove's schemas."""

import math
import zlib
from typing import Any

import msgspec
import pytest
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.Grid_pb2 import Grid

from lockstep.protocol.description import Body
from lockstep.protocol.maps import OccupancyMap
from lockstep.robot_bridge.robots.planar.description import DESCRIPTION
from lockstep.server.recording.format.map_messages import MAP_FRAME, in_world, map_messages
from lockstep.server.recording.format.records import MapRecord, NavigationRecord
from lockstep.server.recording.format.robot_frames import WORLD
from lockstep.server.recording.format.topics import topics_of

AT = 1_500_000_000
CELLS = bytes([0, 100, 255, 50, 0, 0])


def record(**changes: Any) -> MapRecord:
    map = OccupancyMap(id="a", width=3, height=2, resolution=0.5, origin=(1.0, -2.0, 0.0), cells=zlib.compress(CELLS))
    return MapRecord(epoch="e", event=5, map=msgspec.structs.replace(map, **changes))


def test_the_grid_has_the_cells_where_the_map_says() -> None:
    (entry,) = map_messages(DESCRIPTION, record(), AT)
    grid = Grid.FromString(entry.data)
    assert (entry.event, grid.frame_id, grid.data) == (5, MAP_FRAME, CELLS)
    assert (grid.column_count, grid.row_stride, grid.cell_size.x) == (3, 3, 0.5)
    assert (grid.pose.position.x, grid.pose.position.y) == (1.0, -2.0)


@pytest.mark.parametrize("frame", [(0.0, 0.0, 0.0), (1.0, 2.0, 0.5), (-3.0, 0.1, -2.0)])
def test_the_frame_of_the_map_is_where_the_robots_world_is_on_it(frame: tuple[float, float, float]) -> None:
    x, y, yaw = in_world(frame)
    cos, sin = math.cos(frame[2]), math.sin(frame[2])
    there = (frame[0] + cos * x - sin * y, frame[1] + sin * x + cos * y, frame[2] + yaw)
    assert there == pytest.approx((0.0, 0.0, 0.0))
    (entry,) = map_messages(DESCRIPTION, NavigationRecord(epoch="e", event=6, frame=frame), AT)
    (transform,) = FrameTransforms.FromString(entry.data).transforms
    assert (transform.parent_frame_id, transform.child_frame_id) == (WORLD, MAP_FRAME)
    assert (transform.translation.x, transform.translation.y) == pytest.approx((x, y))


def test_a_place_that_is_not_known_and_cells_that_make_no_sense_are_not_shown() -> None:
    assert not list(map_messages(DESCRIPTION, NavigationRecord(epoch="e", event=6, located=False), AT))
    assert not list(map_messages(DESCRIPTION, record(width=4), AT))


def test_a_robot_without_a_map_or_with_a_body_of_that_name_has_no_such_messages() -> None:
    without = msgspec.structs.replace(DESCRIPTION, map=None)
    named = msgspec.structs.replace(DESCRIPTION, bodies=(*DESCRIPTION.bodies, Body(name=MAP_FRAME, parent="")))
    assert not list(map_messages(without, record(), AT))
    assert not list(map_messages(named, record(), AT))
    assert "/map" in {topic.name for topic in topics_of(DESCRIPTION, {})}
    assert "/map" not in {topic.name for topic in topics_of(without, {})}
