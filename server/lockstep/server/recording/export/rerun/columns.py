"""Rows for Rerun, collected by entity and sent as columns: one call for many rows costs little more than for one."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import rerun as rr

__all__ = ["Columns", "Moment"]

Build = Callable[[list[Any]], Any]  # the values of all rows -> what Rerun sends


class Moment(NamedTuple):
    """Where a row is on each timeline."""

    event: int
    arrived: int  # ns since 1970
    captured: int


class Columns:
    """Collects rows; `send` hands them to the recording. Used from one thread.

    The timelines are `event`, a sequence, and `arrived` and `captured`, which are times.
    """

    def __init__(self, stream: rr.RecordingStream) -> None:
        self.waiting = 0  # rows
        self.waiting_bytes = 0
        self._stream = stream
        self._rows: dict[tuple[str, Build], list[tuple[Moment, Any]]] = {}

    def scalars(self, path: str, at: Moment, values: Sequence[float]) -> None:
        self._add(path, _scalars, at, values)

    def points(self, path: str, at: Moment, positions: list[tuple[float, float, float]]) -> None:
        self._add(path, _points, at, positions)

    def strip(self, path: str, at: Moment, positions: list[tuple[float, float, float]]) -> None:
        self._add(path, _strips, at, positions)

    def grid(self, path: str, at: Moment, grid: dict[str, Any]) -> None:
        """Place a map; `grid`: the fields of Rerun's GridMap but for the colours."""
        self.waiting_bytes += len(grid["data"])
        self._add(path, _grids, at, grid)

    def pose(self, path: str, at: Moment, position: Sequence[float], orientation: Sequence[float]) -> None:
        """Place an entity in its parent. `orientation`: w, x, y, z."""
        w, x, y, z = orientation
        self._add(path, _poses, at, (position, (x, y, z, w)))

    def picture(self, path: str, at: Moment, picture: bytes, *, keyframe: bool) -> None:
        self.waiting_bytes += len(picture)
        self._add(path, _pictures, at, (picture, keyframe))

    def state(self, path: str, at: Moment, state: str) -> None:
        """Tell a state that holds from here on; "": none does."""
        self._add(path, _states, at, state)

    def text(self, path: str, at: Moment, text: str, *, warning: bool) -> None:
        self._add(path, _texts, at, (text, rr.TextLogLevel.WARN if warning else rr.TextLogLevel.INFO))

    def _add(self, path: str, build: Build, at: Moment, value: Any) -> None:
        self.waiting += 1
        self._rows.setdefault((path, build), []).append((at, value))

    def send(self) -> None:
        """Hand all rows to the recording. Blocks while its sink has no room."""
        rows, self._rows = self._rows, {}
        self.waiting = self.waiting_bytes = 0
        for (path, build), found in rows.items():
            moments = [moment for moment, _ in found]
            times = [
                rr.TimeColumn("event", sequence=[each.event for each in moments]),
                rr.TimeColumn("arrived", timestamp=_times(each.arrived for each in moments)),
                rr.TimeColumn("captured", timestamp=_times(each.captured for each in moments)),
            ]
            self._stream.send_columns(path, indexes=times, columns=build([value for _, value in found]))


def _times(nanoseconds: Any) -> Any:
    return np.fromiter(nanoseconds, dtype=np.int64).astype("datetime64[ns]")


def _scalars(rows: list[Any]) -> Any:
    values = np.array([value for row in rows for value in row], dtype=np.float64)
    return rr.Scalars.columns(scalars=values).partition([len(row) for row in rows])


def _points(rows: list[Any]) -> Any:
    positions = np.array([point for row in rows for point in row], dtype=np.float32).reshape(-1, 3)
    return rr.Points3D.columns(positions=positions).partition([len(row) for row in rows])


def _strips(rows: list[Any]) -> Any:
    strips = [[positions] if len(positions) > 1 else [] for positions in rows]
    found = rr.LineStrips3D.columns(strips=[strip for row in strips for strip in row])
    return found.partition([len(row) for row in strips])


def _grids(rows: list[Any]) -> Any:
    fields = {name: [row[name] for row in rows] for name in rows[0]}
    return rr.GridMap.columns(**fields, colormap=[rr.components.Colormap.RvizMap] * len(rows))


def _poses(rows: list[Any]) -> Any:
    positions = np.array([position for position, _ in rows], dtype=np.float32)
    turns = np.array([turn for _, turn in rows], dtype=np.float32)
    return rr.Transform3D.columns(translation=positions, quaternion=turns)


def _pictures(rows: list[Any]) -> Any:
    pictures = [np.frombuffer(picture, dtype=np.uint8) for picture, _ in rows]
    return rr.VideoStream.columns(sample=pictures, is_keyframe=[keyframe for _, keyframe in rows])


def _states(rows: list[Any]) -> Any:
    return rr.StateChange.columns(state=rows)


def _texts(rows: list[Any]) -> Any:
    return rr.TextLog.columns(text=[text for text, _ in rows], level=[level for _, level in rows])
