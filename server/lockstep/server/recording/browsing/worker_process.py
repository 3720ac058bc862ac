"""The process that reads recordings for the console: a file that is large, slow or hostile harms nobody who drives.

Each line of its input is a job as JSON; it answers each in turn, as `jobs` says. It runs with a low priority and
bounded memory. The end of its input means that the console does not need it any more.
"""

import os
import resource
import sys
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

import msgspec

from lockstep.server.errors import NotAllowed
from lockstep.server.recording.browsing.jobs import (
    ANSWER,
    STATUSES,
    Job,
    JobStatus,
    ListEpisodes,
    MakeReport,
    ShowPicture,
    decode_job,
)
from lockstep.server.recording.episodes.edits import read_edits
from lockstep.server.recording.episodes.episode_list import listed_episodes
from lockstep.server.recording.errors import RecordingError
from lockstep.server.recording.reading.known_indexes import KnownIndexes
from lockstep.server.recording.reading.picture_at import picture_at
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.recording.recording_store import entry_of
from lockstep.server.recording.rights import RecordingReaderRight

__all__ = ["main"]

NICENESS = 15  # what it does can wait; an operator's pictures cannot
MAX_MEMORY = 3 * 1024**3  # bytes of address space

Answer = tuple[JobStatus, bytes]


class Worker:
    def __init__(self) -> None:
        self._indexes = KnownIndexes()

    def do(self, job: Job) -> Answer:
        try:
            match job:
                case ListEpisodes():
                    return self._list(Path(job.path))
                case ShowPicture():
                    return self._show(job)
                case MakeReport():
                    return self._report(Path(job.path))
        except NotAllowed as error:
            return "not_allowed", error.detail.encode()
        except RecordingError as error:
            return "damaged", error.detail.encode(errors="replace")
        except FileNotFoundError:
            return "deleted", b""
        except OSError as error:
            return "unreadable", (error.strerror or type(error).__name__).encode()
        except MemoryError:
            return "damaged", b"it needs too much memory"

    def _list(self, path: Path) -> Answer:
        with self._indexes.open(path) as reader:
            entry = entry_of(path, reader.info, reader.index, interrupted=reader.interrupted)
            try:
                edits, trouble = read_edits(path), ""
            except OSError as error:
                edits, trouble = [], f"the changes cannot be read: {error.strerror}"
            return "done", msgspec.json.encode(listed_episodes(entry, reader.index, edits, trouble))

    def _show(self, job: ShowPicture) -> Answer:
        path = Path(job.path)
        with self._indexes.open(path) if job.index is None else RecordingReader(path, job.index) as reader:
            if job.since is not None:
                reader.index = RecordingReaderRight("observer", job.since).part_of(reader.index)
            found = picture_at(reader, job.camera, job.event, job.width)
        return ("nothing", b"") if found is None else ("done", found.stamp.to_bytes(4, "big") + found.jpeg)

    def _report(self, path: Path) -> Answer:
        from lockstep.server.recording.report.page import session_page

        return "done", session_page(path, alone=True).encode()  # others may be large, or still be written


def serve(source: BinaryIO, out: BinaryIO) -> None:
    worker = Worker()
    for line in source:
        status, body = worker.do(decode_job(line))
        out.write(ANSWER.pack(STATUSES.index(status), len(body)) + body)
        out.flush()


def main() -> None:
    os.nice(NICENESS)
    resource.setrlimit(resource.RLIMIT_AS, (MAX_MEMORY, MAX_MEMORY))
    out = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # output that a library prints is no answer
    with suppress(OSError, KeyboardInterrupt):
        serve(sys.stdin.buffer, out)
    os._exit(0)


if __name__ == "__main__":
    main()
