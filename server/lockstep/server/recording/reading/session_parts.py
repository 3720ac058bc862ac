"""The files of one session: a recording begins a new part when the robot's bridge was restarted, or a file is large."""

import glob
from pathlib import Path
from typing import NamedTuple

from lockstep.server.recording.errors import RecordingError
from lockstep.server.recording.reading.reader import RecordingReader

__all__ = ["SessionParts", "session_parts"]


class SessionParts(NamedTuple):
    """
    Attributes:
        files: in their order
        unread: names of files beside them that cannot be read
    """

    files: list[Path]
    unread: list[str]


def session_parts(path: Path) -> SessionParts:
    """Return the parts of the session that begins with `path`; of a later part, that file alone.

    Raises:
        RecordingError, OSError: `path` cannot be read.
    """
    with RecordingReader(path) as reader:
        first = reader.info
    found, unread = {1: path}, list[str]()
    if first.part != 1:
        return SessionParts([path], [])
    for other in sorted(path.parent.glob(f"{glob.escape(path.stem)}-p*{path.suffix}")):
        try:
            with RecordingReader(other) as reader:
                info = reader.info
        except (RecordingError, OSError):
            unread.append(other.name)
            continue
        if info.recording == first.recording:
            found.setdefault(info.part, other)
    return SessionParts([found[part] for part in sorted(found)], unread)
