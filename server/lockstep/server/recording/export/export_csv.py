"""`lockstep export --to csv`: one row for each event."""

import csv
from pathlib import Path

from lockstep.server.recording.episodes.edits import edited, read_edits
from lockstep.server.recording.export.lerobot_rows import episodes_of
from lockstep.server.recording.export.unfinished import unfinished_file
from lockstep.server.recording.format.topics import stream_of
from lockstep.server.recording.reading.event_rows import columns_of, event_rows, values_of
from lockstep.server.recording.reading.reader import RecordingReader

__all__ = ["export"]


def export(path: Path, out: Path | None, task: str, *, kept: bool = False) -> list[Path]:
    """Write and return the file: `out`, or one beside `path`. `kept`: rows of kept episodes alone.

    Raises:
        RecordingError, OSError: it cannot be read or written.
    """
    target = out or path.with_suffix(".csv")
    with (
        RecordingReader(path) as reader,
        unfinished_file(target) as partial,
        partial.open("w", newline="", encoding="utf-8") as file,
    ):
        description = reader.description()
        episodes = edited(episodes_of(reader), read_edits(path))
        has_episodes = bool(episodes)
        streams = [stream for each in reader.index.topics if (stream := stream_of(each.topic))]
        writer = csv.writer(file)
        writer.writerow(columns_of(description, streams, has_episodes=has_episodes))
        for row in event_rows(reader, episodes, kept=kept):
            writer.writerow([_cell(value) for value in values_of(row, description, streams, has_episodes=has_episodes)])
    return [target]


def _cell(value: object) -> object:
    """Put an apostrophe before a text that a spreadsheet would calculate: people choose their names."""
    if isinstance(value, str) and value.startswith(("=", "+", "-", "@")):
        return f"'{value}"
    return "" if value is None else value
