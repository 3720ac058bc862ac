"""The role of each peer that held the control seat in a recording."""

from lockstep.server.recording.format.payload import own_record_of
from lockstep.server.recording.format.records import SeatRecord
from lockstep.server.recording.format.topics import OWN_TOPICS
from lockstep.server.recording.reading.reader import RecordingReader

__all__ = ["SeatRoles"]

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

    def of(self, peer: str) -> str:
        """Return the role with which the peer held the seat last; "" if that is not known."""
        return self._roles.get(peer, "")
