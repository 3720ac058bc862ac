"""Reads a recording that is still written, from where the last reading has ended."""

from pathlib import Path

from lockstep.protocol.files.regular_file import open_regular
from lockstep.server.recording.errors import RecordingDamaged
from lockstep.server.recording.format.event_index import EventIndex
from lockstep.server.recording.format.info import RecordingInfo
from lockstep.server.recording.reading.raw_records import BROKEN, MAGIC, raw_records
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.recording.reading.scan import Scan

__all__ = ["GrowingRecording"]


class GrowingRecording:
    """One file. It is never changed, and needs no index: a file that was interrupted is read as far as it is whole.

    Attributes:
        ended: nothing follows any more
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.ended = False
        self._scan: Scan | None = None
        self._looked: tuple[int, int] | None = None  # size and time of change at the last reading

    def advance(self) -> bool:
        """Read what has been written since; True if there was something.

        Raises:
            RecordingDamaged: it is no recording, or broken in what has been written.
            OSError: it cannot be read.
        """
        status = self.path.stat()
        version = status.st_size, status.st_mtime_ns
        if self.ended or version == self._looked or status.st_size <= len(MAGIC):
            return False
        scan = self._scan or Scan(self._info())
        before = scan.whole
        with open_regular(self.path) as file:
            file.seek(scan.whole)
            try:
                for raw in raw_records(file):
                    if not scan.take(raw):
                        self.ended = True
                        break
            except BROKEN as error:
                self.ended = True
                raise RecordingDamaged(f"{self.path.name}: {error or type(error).__name__}") from error
        self._scan, self._looked = scan, version
        return scan.whole > before

    @property
    def index(self) -> EventIndex:
        """The index of all that was read."""
        return EventIndex() if self._scan is None else self._scan.index

    def reader(self) -> RecordingReader:
        """Return a reader of all that was read. Close it. Raises RecordingError, OSError."""
        return RecordingReader(self.path, self.index)

    def _info(self) -> RecordingInfo:
        with RecordingReader(self.path, EventIndex()) as reader:
            return reader.info
