"""What is in a file of Rerun's, read by Rerun's own library."""

import warnings
from pathlib import Path
from typing import Any, NamedTuple

import pytest

rerun = pytest.importorskip("rerun")

__all__ = ["Entity", "entities", "recording_ids"]


class Entity(NamedTuple):
    """The rows of one entity, in their order on the timeline `event`; static ones apart."""

    rows: list[dict[str, Any]]  # by timeline, in ns or events, and by component: "Scalars:scalars" -> [1.0]
    static: list[dict[str, Any]]

    def column(self, name: str) -> list[Any]:
        return [row[name] for row in self.rows if row.get(name) is not None]


def recording_ids(path: Path) -> list[str]:
    return [entry.recording_id for entry in _reader(path).recordings()]


def entities(path: Path) -> dict[str, Entity]:
    """The entities of the first recording in the file."""
    found: dict[str, Entity] = {}
    for chunk in _reader(path).stream():
        entity = found.setdefault(chunk.entity_path, Entity([], []))
        table = chunk.to_record_batch()
        for name in ("arrived", "captured"):
            if name in table.schema.names:
                table = table.set_column(table.schema.get_field_index(name), name, table[name].cast("int64"))
        (entity.static if chunk.is_static else entity.rows).extend(table.to_pylist())
    for entity in found.values():
        entity.rows.sort(key=lambda row: (row["event"], row["arrived"]))
    return found


def _reader(path: Path) -> Any:
    from rerun.chunk import RrdReader

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a file that was not closed has no index
        return RrdReader(str(path))
