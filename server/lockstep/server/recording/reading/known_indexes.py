"""Opens recordings and caches the indexes of those that were opened last. Blocks; for use from any thread."""

import threading
from collections import OrderedDict
from pathlib import Path

from lockstep.server.recording.format.event_index import EventIndex
from lockstep.server.recording.reading.reader import RecordingReader

__all__ = ["KnownIndexes"]

MOST = 4  # files; the index of a long one takes megabytes


class KnownIndexes:
    """Caches indexes: a player asks for one chunk after the other, and the index need not be read for each."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._known: OrderedDict[Path, tuple[tuple[int, int], EventIndex, bool]] = OrderedDict()

    def open(self, path: Path) -> RecordingReader:
        """Open a file that is not being written; close the reader. Raises RecordingError, OSError."""
        status = path.stat()
        version = status.st_size, status.st_mtime_ns
        with self._lock:
            known = self._known.get(path)
        if known is not None and known[0] == version:
            reader = RecordingReader(path, known[1])
            reader.interrupted = known[2]
            return reader
        reader = RecordingReader(path)
        with self._lock:
            self._known[path] = version, reader.index, reader.interrupted
            self._known.move_to_end(path)
            while len(self._known) > MOST:
                self._known.popitem(last=False)
        return reader
