"""The recordings of a console, or one file. Methods that block say so: call them on a thread."""

from contextlib import suppress
from pathlib import Path
from typing import Protocol

from lockstep.protocol.console import RecordingState
from lockstep.server.errors import AlreadyRecording, NotAllowed, NotFound
from lockstep.server.recording.format.event_index import EventIndex
from lockstep.server.recording.reading.known_indexes import KnownIndexes
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.recording.recording_store import RecordingEntry, entry_of
from lockstep.server.recording.recording_store import recording_id as id_of
from lockstep.server.recording.writing.recorder import Recorder

__all__ = ["ConsoleLibrary", "FileLibrary", "Library"]


class Library(Protocol):
    @property
    def automatic(self) -> bool:
        """True if it records without being asked."""

    def state(self) -> RecordingState: ...

    def start(self, by: str, name: str) -> RecordingState:
        """Start a recording. Raises ConsoleError."""

    async def stop(self) -> RecordingState:
        """End the recording. Raises ConsoleError."""

    def entries(self) -> list[RecordingEntry]:
        """Return the recordings, newest first. Blocks."""

    def open(self, recording_id: str) -> tuple[RecordingReader, RecordingEntry]:
        """Open a recording; close the reader. Blocks. Raises NotFound, RecordingError, OSError."""

    def delete(self, recording_id: str) -> None:
        """Delete a recording. Blocks. Raises NotFound, AlreadyRecording, NotAllowed, OSError."""

    def files(self) -> list[Path]:
        """Return the files, the one that changed last first. Blocks. Raises OSError."""

    def path(self, recording_id: str) -> Path:
        """Return the file. Blocks. Raises NotFound, OSError."""

    def running(self) -> Path | None:
        """Return the file that this console writes now."""


class ConsoleLibrary:
    """The recordings of a running console, with the file that is being written."""

    def __init__(self, recorder: Recorder) -> None:
        self._recorder = recorder
        self._indexes = KnownIndexes()

    @property
    def automatic(self) -> bool:
        return self._recorder.automatic

    def state(self) -> RecordingState:
        return self._recorder.state()

    def start(self, by: str, name: str) -> RecordingState:
        return self._recorder.start(by, name)

    async def stop(self) -> RecordingState:
        return await self._recorder.stop()

    def entries(self) -> list[RecordingEntry]:
        found = self._recorder.shelf.entries()
        running = self._running()
        if running is not None and running[1].chunks:
            with RecordingReader(*running) as reader:
                found.insert(0, entry_of(running[0], reader.info, reader.index, running=True))
        return found

    def open(self, recording_id: str) -> tuple[RecordingReader, RecordingEntry]:
        running = self._running()
        if running is not None and running[0].stem == recording_id:
            reader = RecordingReader(*running)
            return reader, entry_of(reader.path, reader.info, reader.index, running=True)
        path = self._recorder.shelf.path(recording_id)
        if path is None:
            raise NotFound("no such recording")
        return _open(path, self._indexes)

    def delete(self, recording_id: str) -> None:
        running = self._running()
        if running is not None and running[0].stem == recording_id:
            raise AlreadyRecording("the recording is still being written; stop it first")
        path = self._recorder.shelf.path(recording_id)
        if path is None:
            raise NotFound("no such recording")
        self._recorder.shelf.delete(path)

    def files(self) -> list[Path]:
        return _newest_first(self._recorder.shelf.files())

    def path(self, recording_id: str) -> Path:
        running = self.running()
        if running is not None and id_of(running) == recording_id:
            return running
        path = self._recorder.shelf.path(recording_id)
        if path is None:
            raise NotFound("no such recording")
        return path

    def running(self) -> Path | None:
        running = self._running()
        return None if running is None or not running[1].chunks else running[0]

    def _running(self) -> tuple[Path, EventIndex] | None:
        thread = self._recorder.running
        path, index = (None, None) if thread is None else (thread.parts.path, thread.parts.index())
        return None if path is None or index is None else (path, index)


class FileLibrary:
    """One file, for `lockstep replay`."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._indexes = KnownIndexes()

    automatic = False

    def state(self) -> RecordingState:
        return RecordingState(state="off")

    def start(self, by: str, name: str) -> RecordingState:
        raise NotAllowed("there is no robot here, only a recording")

    async def stop(self) -> RecordingState:
        return self.state()

    def entries(self) -> list[RecordingEntry]:
        reader, entry = _open(self._path, self._indexes)
        reader.close()
        return [entry]

    def open(self, recording_id: str) -> tuple[RecordingReader, RecordingEntry]:
        if recording_id != id_of(self._path):
            raise NotFound("no such recording")
        return _open(self._path, self._indexes)

    def delete(self, recording_id: str) -> None:
        raise NotAllowed("a replayed file cannot be deleted here")

    def files(self) -> list[Path]:
        return [self._path]

    def path(self, recording_id: str) -> Path:
        if recording_id != id_of(self._path):
            raise NotFound("no such recording")
        return self._path

    def running(self) -> Path | None:
        return None


def _newest_first(paths: list[Path]) -> list[Path]:
    dated = []
    for path in paths:
        with suppress(OSError):  # it was deleted meanwhile
            dated.append((path.stat().st_mtime_ns, path))
    return [path for _, path in sorted(dated, reverse=True)]


def _open(path: Path, indexes: KnownIndexes) -> tuple[RecordingReader, RecordingEntry]:
    reader = indexes.open(path)
    try:
        return reader, entry_of(path, reader.info, reader.index, interrupted=reader.interrupted)
    except OSError:
        reader.close()
        raise
