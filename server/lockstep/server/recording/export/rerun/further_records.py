"""What Rerun gets beside the robot itself: maps, shadows, status, people, their reports, and traces."""

import math
from collections.abc import Sequence
from typing import Any

import msgspec
import numpy as np
import rerun as rr

from lockstep.protocol.description import RobotDescription
from lockstep.protocol.errors import MessageError
from lockstep.protocol.maps import OccupancyMap, map_cells
from lockstep.protocol.traces.trace import COMMAND_WAY, PICTURE_WAY, CommandSpans, PictureSpans, Span
from lockstep.server.recording.export.rerun.bodies import entity
from lockstep.server.recording.export.rerun.columns import Columns, Moment
from lockstep.server.recording.format.map_messages import in_world
from lockstep.server.recording.format.records import (
    MapRecord,
    NavigationRecord,
    OwnRecord,
    ParticipantsRecord,
    ReportRecord,
    ShadowRecord,
    StatusRecord,
    TraceRecord,
)

__all__ = ["FurtherRecords"]

MAP, GRID, PATH, GOAL = "/map", "/map/grid", "/map/path", "/map/goal"
PEOPLE = "/people"
REPORTED = ("gap", "largest gap", "discarded", "tolerance")
DELAYS = ("command to picture, ms", "round trip, ms")
# Of an epoch. Peers name themselves and their shadows, and may do so anew each time they connect: they use up no room
# but their own.
MOST_ENTITIES = 1000  # of the robot
MOST_PEER_ENTITIES = 1000


class FurtherRecords:
    """Takes those records, in the order of their arrival, and adds their rows to `columns`.

    Peers choose some of the names in them. Rerun keeps an entity for ever, so a stream that the robot does not have,
    and an entity above `MOST_ENTITIES`, or of peers above `MOST_PEER_ENTITIES`, are left out.
    """

    def __init__(self, stream: rr.RecordingStream, columns: Columns) -> None:
        self._stream = stream
        self._columns = columns
        self._axes: list[str] = []
        self._streams: frozenset[str] = frozenset()
        self._own = _Entities(MOST_ENTITIES)
        self._peers = _Entities(MOST_PEER_ENTITIES)
        self._named: set[str] = set()  # entities whose lines have names
        self._states: dict[str, str] = {}  # by entity, as told last

    def begin(self, description: RobotDescription) -> None:
        """Take the names of the robot's axes, cameras and microphones."""
        self._axes = [axis.name for axis in description.axes]
        cameras, microphones = description.cameras, description.microphones
        self._streams = frozenset([each.name for each in cameras] + [each.name for each in microphones])
        self._named.clear()

    def take(self, record: OwnRecord, at: Moment) -> None:
        """Take a record; one of another kind is left out."""
        match record:
            case MapRecord():
                self._map(record.map, at)
            case NavigationRecord():
                self._navigation(record, at)
            case ShadowRecord():
                path = entity("shadow", record.name)
                self._lines(self._peers, f"{path}/wanted", self._axes, at, record.values)
                if record.difference is not None:
                    self._lines(self._peers, f"{path}/difference", ["share of the range"], at, [record.difference])
            case StatusRecord():
                for item in record.items:
                    path = entity("status", item.name)
                    if isinstance(item.value, str):
                        self.state(path, at, item.value)
                    else:
                        label = f"{item.label}, {item.unit}".strip(", ")
                        self._lines(self._own, path, [label], at, [float(item.value)])
                    self.state(f"{path}/level", at, item.level)
            case ParticipantsRecord():
                self.state(PEOPLE, at, ", ".join(f"{each.name} ({each.role})" for each in record.participants))
            case ReportRecord():
                self._report(record, at)
            case TraceRecord():
                self._trace(record, at)

    def state(self, path: str, at: Moment, state: str) -> None:
        """Tell a state where it changes; "": none holds."""
        if self._states.get(path, "") != state and self._own.has_room(path):
            self._states[path] = state
            self._columns.state(path, at, state)

    def _lines(
        self, bound: "_Entities", path: str, names: list[str], at: Moment, values: Sequence[float | None]
    ) -> None:
        if not bound.has_room(path):
            return
        if path not in self._named:
            self._named.add(path)
            self._stream.log(path, rr.SeriesLines(names=names), static=True)
        self._columns.scalars(path, at, [math.nan if value is None else value for value in values])

    def _map(self, map: OccupancyMap, at: Moment) -> None:
        try:
            cells = map_cells(map)
        except MessageError:
            return  # its cells are not what it says
        rows = np.frombuffer(cells, dtype=np.uint8).reshape(map.height, map.width)
        x, y, yaw = map.origin
        grid = {
            "data": rows[::-1].tobytes(),  # the first row of an image is the uppermost
            "format": rr.components.ImageFormat(
                width=map.width, height=map.height, color_model="L", channel_datatype="U8"
            ),
            "cell_size": map.resolution,
            "translation": (x, y, 0.0),
            "quaternion": (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)),
        }
        self._columns.grid(GRID, at, grid)

    def _navigation(self, record: NavigationRecord, at: Moment) -> None:
        if record.located:
            x, y, yaw = in_world(record.frame)
            self._columns.pose(MAP, at, (x, y, 0.0), (math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)))
        self._columns.strip(PATH, at, [(x, y, 0.0) for x, y in zip(record.path[::2], record.path[1::2], strict=False)])
        self._columns.points(GOAL, at, [(record.goal[0], record.goal[1], 0.0)] if len(record.goal) >= 2 else [])

    def _report(self, record: ReportRecord, at: Moment) -> None:
        path, report = entity("reports", record.name), record.report
        delays = [report.picture_delay_ms, report.round_trip_ms]
        self._lines(self._peers, f"{path}/delays", list(DELAYS), at, delays)
        for each in report.streams:
            values = [each.gap, each.max_gap, each.discarded, each.tolerance]
            if each.stream in self._streams:
                self._lines(self._peers, f"{path}{entity(each.stream)}", list(REPORTED), at, values)

    def _trace(self, record: TraceRecord, at: Moment) -> None:
        self._way("/trace/command", COMMAND_WAY, record.command, at)
        if record.stream in self._streams:
            self._way(f"/trace/picture{entity(record.stream)}", PICTURE_WAY, record.picture, at)

    def _way(self, path: str, way: Sequence[Span], spans: CommandSpans | PictureSpans, at: Moment) -> None:
        found: list[Any] = [getattr(spans, each.name) for each in way]
        values = [None if value is msgspec.UNSET else value for value in found]
        if any(value is not None for value in values):
            self._lines(self._own, path, [each.name.removesuffix("_ms") for each in way], at, values)


class _Entities:
    """The entities that have rows, up to a bound."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._paths: set[str] = set()

    def has_room(self, path: str) -> bool:
        """Return whether an entity may have rows: one that has some, or a new one below the bound."""
        if len(self._paths) < self._most:
            self._paths.add(path)
        return path in self._paths
