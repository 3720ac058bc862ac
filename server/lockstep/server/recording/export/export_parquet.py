"""`lockstep export --to parquet`: one row for each event. Needs pyarrow."""

from itertools import islice
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from lockstep.server.recording.episodes.edits import edited, read_edits
from lockstep.server.recording.export.lerobot_rows import episodes_of
from lockstep.server.recording.export.unfinished import unfinished_file
from lockstep.server.recording.format.topics import stream_of
from lockstep.server.recording.reading.event_rows import columns_of, event_rows, values_of
from lockstep.server.recording.reading.reader import RecordingReader

__all__ = ["export"]

ROWS = 10_000  # of a group
TYPES = {int: pa.int64(), float: pa.float64(), bool: pa.bool_(), str: pa.string()}


def export(path: Path, out: Path | None, task: str, *, kept: bool = False) -> list[Path]:
    """Write and return the file: `out`, or one beside `path`. `kept`: rows of kept episodes alone.

    Raises:
        RecordingError, OSError: it cannot be read or written.
    """
    target = out or path.with_suffix(".parquet")
    with RecordingReader(path) as reader:
        description = reader.description()
        episodes = edited(episodes_of(reader), read_edits(path))
        has_episodes = bool(episodes)
        streams = [stream for each in reader.index.topics if (stream := stream_of(each.topic))]
        metadata = {f"lockstep.{key}": value for key, value in reader.info.metadata().items()}
        fields = [
            (name, TYPES[kind]) for name, kind in columns_of(description, streams, has_episodes=has_episodes).items()
        ]
        schema = pa.schema(fields, metadata=metadata)
        found = event_rows(reader, episodes, kept=kept)
        rows = (values_of(row, description, streams, has_episodes=has_episodes) for row in found)
        with unfinished_file(target) as partial, pq.ParquetWriter(partial, schema) as writer:
            while group := list(islice(rows, ROWS)):
                columns = [list(column) for column in zip(*group, strict=True)]
                writer.write_table(pa.table(columns, schema=schema))
    return [target]
