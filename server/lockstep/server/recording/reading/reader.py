"""Reads a recording by event: through its index, chunk by chunk. Also one that is still written, or was interrupted."""

from collections.abc import Collection, Iterator
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

from mcap.records import Message
from mcap.stream_reader import CRCValidationError

from lockstep.protocol.description import RobotDescription
from lockstep.protocol.serial import is_newer
from lockstep.robot_bridge.description.check_description import check_bounds
from lockstep.robot_bridge.errors import DescriptionError
from lockstep.server.recording.errors import RecordingDamaged, RecordingTampered
from lockstep.server.recording.format.event_index import INDEX_NAME, EventEntry, EventIndex, check_index, decode_index
from lockstep.server.recording.format.info import METADATA_NAME, RecordingInfo
from lockstep.server.recording.format.payload import (
    SOUND,
    VIDEO,
    RecordedPicture,
    RecordedSound,
    own_record,
    payload_of,
    picture_of,
    sound_of,
)
from lockstep.server.recording.format.records import Degraded, RobotRecord
from lockstep.server.recording.format.topics import OWN_TOPICS
from lockstep.server.recording.reading.raw_records import BROKEN, chunk_records
from lockstep.server.recording.reading.record_file import RecordFile
from lockstep.server.recording.reading.scan import scan_file

__all__ = ["Record", "RecordingReader"]

DEGRADED = OWN_TOPICS[Degraded]


class Record(NamedTuple):
    """One record of the file. Times in ns since 1970."""

    topic: str
    schema: str
    event: int
    arrived: int
    captured: int
    data: bytes  # the message as it stands in the file
    chunk: int

    @property
    def payload(self) -> bytes:
        """The bare encoded picture or sound; of every other topic the message itself. Raises RecordingDamaged."""
        return payload_of(self.schema, self.data)

    @property
    def picture(self) -> RecordedPicture | None:
        """The picture, or None. Raises RecordingDamaged."""
        return picture_of(self.data) if self.schema == VIDEO else None

    @property
    def sound(self) -> RecordedSound | None:
        """The sound, or None. Raises RecordingDamaged."""
        return sound_of(self.schema, self.data) if self.schema in SOUND else None

    @property
    def keyframe(self) -> bool:
        """True if it can be decoded without earlier records: always, but for most pictures."""
        picture = self.picture
        return picture is None or picture.keyframe


class RecordingReader:
    """Reads one file. Close it, or use it as a context manager. Use it from one thread at a time.

    Args:
        index: of a file that is still written; None: read it from the file, or build it from the records

    Raises:
        RecordingDamaged: it is no recording.
        OSError: it cannot be read.
    """

    def __init__(self, path: Path, index: EventIndex | None = None) -> None:
        self.path = path
        self.interrupted = False  # neither closed nor still written: the index was built from the records
        self._file = RecordFile(path)
        try:
            self.info = self._read_info()
            self.index = index or self._read_index() or self._scan()
            check_index(self.index)
        except BROKEN as error:
            self._file.close()
            raise RecordingDamaged(f"{path.name}: {error or type(error).__name__}") from error
        except BaseException:
            self._file.close()
            raise
        self._topics = {each.id: each for each in self.index.topics}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        self._file.close()

    def description(self) -> RobotDescription:
        """Return the robot's description. Raises RecordingDamaged when the file has none."""
        for number in range(min(2, len(self.index.chunks))):
            for record in self.chunk(number, {OWN_TOPICS[RobotRecord]}):
                return _shown(own_record(RobotRecord, record.data).description)
        raise RecordingDamaged("the recording has no description of its robot")

    def records(
        self,
        first_event: int | None = None,
        last_event: int | None = None,
        topics: Collection[str] | None = None,
        *,
        decodable: bool = False,
    ) -> Iterator[Record]:
        """Yield the records stamped with `first_event` to `last_event`, in the order of arrival.

        Args:
            first_event, last_event: None: from the beginning, to the end
            topics: None: all
            decodable: pictures come from the last keyframe at or before `first_event` on, and with them, if asked for,
                each `Degraded` from there to the last chunk, of whatever event: later pictures may build on a lost one
        """
        index = self.index
        if first_event is None and last_event is None:
            for number in range(len(index.chunks)):
                yield from self.chunk(number, topics)
            return
        first = index.first_event if first_event is None else first_event
        last = index.last_event if last_event is None else last_event
        starts = self._picture_starts(first, topics) if decodable else {}
        wanted = sorted({*index.chunks_with(first, last), *self._chunks_from(starts, first)})
        if starts and wanted:
            wanted = list(range(wanted[0], wanted[-1] + 1))  # what was lost may be told in a chunk between
        begin = min((each.arrived for each in starts.values()), default=None)
        for number in wanted:
            for record in self.chunk(number, topics):
                if record.topic == DEGRADED and begin is not None and record.arrived // 1000 >= begin:
                    yield record
                    continue
                if is_newer(record.event, last):
                    continue
                if not is_newer(first, record.event) or (
                    record.topic in starts and record.arrived // 1000 >= starts[record.topic].arrived
                ):
                    yield record

    def _picture_starts(self, event: int, topics: Collection[str] | None) -> dict[str, EventEntry]:
        pictured = [topic for topic in self.index.keyframes if topics is None or topic in topics]
        found = {topic: self.index.keyframe_before(topic, event) for topic in pictured}
        return {topic: entry for topic, entry in found.items() if entry is not None}

    def _chunks_from(self, starts: dict[str, EventEntry], event: int) -> Iterator[int]:
        """Yield the chunks from the earliest of the keyframes to the event."""
        if starts:
            first = min(entry.chunk for entry in starts.values())
            until = next(iter(self.index.chunks_with(event, event)), first)
            yield from range(first, min(until + 1, len(self.index.chunks)))

    def chunk(self, number: int, topics: Collection[str] | None = None) -> Iterator[Record]:
        """Yield the records of one chunk.

        Raises:
            IndexError: there is no such chunk.
            RecordingTampered: its checksum does not fit.
            RecordingDamaged: it cannot be read.
        """
        if not 0 <= number < len(self.index.chunks):
            raise IndexError(number)
        try:
            parts = chunk_records(self._file.chunk(self.index.chunks[number].offset))
        except CRCValidationError as error:
            raise RecordingTampered(f"chunk {number} was changed after it was written") from error
        except BROKEN as error:
            raise RecordingDamaged(f"chunk {number}: {error}") from error
        for part in parts:
            topic = self._topics.get(part.channel_id) if isinstance(part, Message) else None
            if topic is None or not isinstance(part, Message) or (topics is not None and topic.topic not in topics):
                continue
            yield Record(topic.topic, topic.schema, part.sequence, part.log_time, part.publish_time, part.data, number)

    def _read_info(self) -> RecordingInfo:
        metadata = self._file.metadata()
        if metadata.name != METADATA_NAME:
            raise RecordingDamaged(f"{self.path.name} is not a recording of Lockstep")
        return RecordingInfo.parse(metadata.metadata)

    def _read_index(self) -> EventIndex | None:
        """Return the index; None if the file was not closed."""
        text = self._file.attachment(INDEX_NAME)
        return None if text is None else decode_index(text)

    def _scan(self) -> EventIndex:
        self.interrupted = True
        return scan_file(self.path, self.info).index


def _shown(description: RobotDescription) -> RobotDescription:
    """Check the description: the maker of the file may have written anything. Raises RecordingDamaged."""
    try:
        check_bounds(description)
    except DescriptionError as error:
        raise RecordingDamaged(f"the robot's description: {error}") from error
    return description
