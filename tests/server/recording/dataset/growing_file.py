"""A recording that is written step by step, as by a console."""

from collections.abc import Sequence
from pathlib import Path

from lockstep.server.recording.format.records import EpisodeRecord
from lockstep.server.recording.writing.writer import Entry, RecordingWriter
from tests.server.recording.makers import CODECS, DESCRIPTION, INFO, Story

__all__ = ["GrowingFile"]


class GrowingFile:
    """The story of 100 events, with these records in it."""

    def __init__(self, path: Path, records: Sequence[Entry], events: int = 100) -> None:
        self.path = path
        entries = [*Story(events=events, real=True).entries(), *records]
        self._entries = sorted(entries, key=lambda entry: entry.arrived)
        self._writer = RecordingWriter(path, INFO, DESCRIPTION, CODECS, None)

    def write_until(self, event: int) -> None:
        """Write everything up to the event; it is on the disk then."""
        while self._entries and self._entries[0].event <= event:
            entry = self._entries.pop(0)
            self._writer.flush_if_due(entry.arrived)
            self._writer.write(entry)
            if isinstance(entry.record, EpisodeRecord) and entry.record.kind == "kept":
                self._writer.flush()
        if not self._entries:
            self._writer.close()
