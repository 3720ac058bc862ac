"""The rights to recordings: one rule for lists, chunks, records and files (docs/recording.md). No I/O, no clock.

| | observer, policy | operator | supervisor |
|---|---|---|---|
| list, details | of what reaches into the time of the link | the same | all |
| chunks, records | begun while the link existed | the same | all |
| file | – | begun while the link existed | all |
| start | – | yes | yes |
| end | – | yes; an automatic recording: with the seat | yes |
| delete | – | – | yes |

The caller has checked that the link is good now, and for this robot. Times are µs since 1970.
"""

from typing import NamedTuple

from lockstep.protocol.console import Role
from lockstep.server.errors import NotAllowed
from lockstep.server.recording.format.event_index import EventIndex

__all__ = ["RecordingReaderRight", "check_end"]

BEFORE = "this was recorded before your link was made"


class RecordingReaderRight(NamedTuple):
    """The right of one link to read recordings.

    Attributes:
        since: when the link was made; None: it may read everything
    """

    role: Role
    since: int | None

    @classmethod
    def of(cls, role: Role, issued: float) -> "RecordingReaderRight":
        """Make the right of a link. `issued`: s since 1970; infinite where that is not known, which opens nothing."""
        if role == "supervisor":
            return cls(role, None)
        return cls(role, int(min(issued, 1e12) * 1e6))

    def sees(self, ended: int) -> bool:
        """True if a recording that ended then is in the list."""
        return self.since is None or ended >= self.since

    def reads(self, started: int) -> bool:
        """True if a chunk, or a whole file, that began then may be read."""
        return self.since is None or started >= self.since

    def check_reads(self, started: int) -> None:
        """Raise NotAllowed unless a chunk or file that began then may be read."""
        if not self.reads(started):
            raise NotAllowed(BEFORE)

    def part_of(self, index: EventIndex) -> EventIndex:
        """Return the part of the index that may be read. Its chunks stay, so that their numbers do.

        Raises:
            NotAllowed: nothing may be read.
        """
        if self.since is None or all(self.reads(chunk.started) for chunk in index.chunks):
            return index
        first = next((at for at, chunk in enumerate(index.chunks) if self.reads(chunk.started)), None)
        if first is None:
            raise NotAllowed(BEFORE)
        return index.without_chunks_before(first)


def check_end(role: Role, *, automatic: bool, holds_seat: bool) -> None:
    """Raise NotAllowed unless that role may end the running recording."""
    if role not in ("operator", "supervisor"):
        raise NotAllowed("only the operator or the supervisor may do this")
    if automatic and role != "supervisor" and not holds_seat:
        raise NotAllowed("only the holder of the seat or a supervisor may end an automatic recording")
