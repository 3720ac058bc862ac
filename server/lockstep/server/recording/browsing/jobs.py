"""What the process that reads recordings is asked for, and how it answers. No I/O."""

import struct
from typing import Literal

import msgspec

from lockstep.server.recording.format.event_index import EventIndex

__all__ = [
    "ANSWER",
    "MAX_ANSWER",
    "STATUSES",
    "Job",
    "JobStatus",
    "ListEpisodes",
    "MakeReport",
    "ShowPicture",
    "decode_job",
]

JobStatus = Literal["done", "damaged", "unreadable", "deleted", "not_allowed", "nothing"]
STATUSES: tuple[JobStatus, ...] = ("done", "damaged", "unreadable", "deleted", "not_allowed", "nothing")
ANSWER = struct.Struct(">BI")  # place of the status in STATUSES, length of the body, which follows
MAX_ANSWER = 64 * 1024 * 1024


class ListEpisodes(msgspec.Struct, frozen=True, tag=True):
    """Answered with `RecordingEpisodes` as JSON."""

    path: str


class ShowPicture(msgspec.Struct, frozen=True, tag=True, kw_only=True):
    """Answered with four bytes, the stamp, and a JPEG.

    Attributes:
        since: µs since 1970; nothing that began before is read; None: everything may be
        index: of a file that is still written, with the chunks that are needed; None: the file has one
    """

    path: str
    camera: str
    event: int
    width: int
    since: int | None = None
    index: EventIndex | None = None


class MakeReport(msgspec.Struct, frozen=True, tag=True):
    """Answered with an HTML page."""

    path: str


Job = ListEpisodes | ShowPicture | MakeReport
_decoder = msgspec.json.Decoder(Job)


def decode_job(line: bytes) -> Job:
    job: Job = _decoder.decode(line)
    return job
