"""The role of each peer that held the control seat in a recording."""

from typing import Literal

from lockstep.server.recording.format.payload import own_record_of
from lockstep.server.recording.format.records import SeatRecord
from lockstep.server.recording.format.topics import OWN_TOPICS
from lockstep.server.recording.reading.reader import RecordingReader

__all__ = ["DriverKind", "SeatRoles"]

DriverKind = Literal["human", "policy"]
POLICY = "policy"  # the role of a program that drives

SEAT = {OWN_TOPICS[SeatRecord]}


class SeatRoles:
    """Of one recording, which may still be written: each `read` goes on where the one before has ended."""

    def __init__(self) -> None:
        self._roles: dict[str, str] = {}
        self._chunks = 0

    def read(self, reader: RecordingReader) -> None:
        """Read the chunks that are in the index now. Raises RecordingError."""
        for number in range(self._chunks, len(reader.index.chunks)):
            for record in reader.chunk(number, SEAT):
                seat = own_record_of(record.schema, record.data)
                if isinstance(seat, SeatRecord) and seat.holder:
                    self._roles[seat.holder] = seat.role
        self._chunks = len(reader.index.chunks)

    def kind(self, peer: str) -> DriverKind:
        """Return whether the peer held the seat as a policy; a peer that is not known is a person."""
        return "policy" if self._roles.get(peer) == POLICY else "human"
