"""The files of one session: a recording begins a new part when the robot's bridge was restarted, or a file is large."""

import glob
from pathlib import Path
from typing import Final, NamedTuple

from lockstep.server.recording.errors import RecordingError
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.recording.recording_store import is_written

__all__ = ["MOST_BYTES", "SessionParts", "session_parts"]

MOST_BYTES: Final = 4_000_000_000  # of all parts together; larger ones are told each by itself


class SessionParts(NamedTuple):
    """
    Attributes:
        files: in their order
        left_out: in words, which files beside them are not among them, and why
    """

    files: list[Path]
    left_out: list[str]


def session_parts(path: Path) -> SessionParts:
    """Return the parts of the session that begins with `path`; of a later part, that file alone.

    Raises:
        RecordingError, OSError: `path` cannot be read.
    """
    with RecordingReader(path) as reader:
        first = reader.info
    found, left_out = {1: path}, list[str]()
    if first.part != 1:
        return SessionParts([path], [])
    size = path.stat().st_size
    for other in sorted(path.parent.glob(f"{glob.escape(path.stem)}-p*{path.suffix}")):
        try:
            if is_written(other):
                left_out.append(f"{other.name} is still being written")
                continue
            with RecordingReader(other) as reader:
                info = reader.info
        except (RecordingError, OSError):
            left_out.append(f"{other.name} cannot be read")
            continue
        if info.recording == first.recording and info.part not in found:
            found[info.part] = other
            size += other.stat().st_size
    files = [found[part] for part in sorted(found)]
    if size > MOST_BYTES:
        left_out += [f"{other.name} is told by itself, since all together are too large" for other in files[1:]]
        files = files[:1]
    return SessionParts(files, left_out)
