"""Writes one recording file: MCAP, in chunks that are on the disk within a second. Used from one thread."""

import fcntl
import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO, NamedTuple

import msgspec
from mcap.writer import CompressionType, Writer

from lockstep.protocol.description import RobotDescription
from lockstep.server.recording.errors import DiskTrouble
from lockstep.server.recording.format.event_index import INDEX_NAME, Ending, EventIndex, IndexBuilder, TopicEntry
from lockstep.server.recording.format.info import METADATA_NAME, RecordingInfo
from lockstep.server.recording.format.records import EpisodeRecord, FeedbackRecord, OwnRecord
from lockstep.server.recording.format.signature import RecordingSigning, Signatures, TopicText
from lockstep.server.recording.format.topics import SIGNATURE, Topic, topics_of
from lockstep.server.recording.reading.bookmarks import BookmarkFinder

__all__ = ["Entry", "RecordingWriter"]

CHUNK_SECONDS = 0.9  # together with the rest of the way to the disk less than a second
CHUNK_BYTES = 1_000_000
NEVER = 1 << 62  # bytes; chunks end when this file says so
LIBRARY = "lockstep"


class Entry(NamedTuple):
    """One record on its way to the file."""

    topic: str
    event: int
    arrived: int  # ns since 1970; never decreases
    captured: int  # ns since 1970
    data: bytes
    keyframe: bool = False  # of a picture
    record: OwnRecord | None = None  # `data` decoded, for the index; None for media and the like


class RecordingWriter:
    """Writes one file: `write` and `flush_if_due` in turn, `close` at the end.

    Args:
        signing: signs each chunk; None: chunks are not signed
        previous: head of the part before

    Raises:
        DiskTrouble: by all of them. Flushed chunks stay whole; call `abandon` then.
    """

    def __init__(
        self,
        path: Path,
        info: RecordingInfo,
        description: RobotDescription,
        codecs: Mapping[str, str],
        signing: RecordingSigning | None = None,
        previous: str = "",
    ) -> None:
        self.path = path
        self.info = info
        topics = topics_of(description, codecs, signed=signing is not None)
        self._signatures: Signatures | None = None
        if signing is not None:
            self._signatures = Signatures(signing, info, map(_text, topics), previous)
        self._newest = 0  # ns, arrival of the last record
        self._builder = IndexBuilder(EventIndex(epoch=info.epoch, recording=info.recording, part=info.part))
        self._marks = BookmarkFinder(description)
        self._channels: dict[str, int] = {}
        self._waiting = 0  # bytes in the chunk that is being filled
        self._chunk_since: int | None = None  # ns, arrival of its first record
        try:
            self._file: BinaryIO = path.open("xb")
            fcntl.flock(self._file, fcntl.LOCK_EX)  # held while writing; a list of files takes it only for a moment
        except OSError as error:
            raise DiskTrouble(_reason(error)) from error
        self._writer = Writer(self._file, chunk_size=NEVER, compression=CompressionType.ZSTD)
        self._whole = 0  # bytes of the file that are complete records
        try:
            self._writer.start(profile="", library=LIBRARY)
            self._writer.add_metadata(METADATA_NAME, info.metadata())
            self._register(topics, info.epoch)
            self._sync()
        except OSError as error:
            self.abandon()
            raise DiskTrouble(_reason(error)) from error

    def _register(self, topics: list[Topic], epoch: str) -> None:
        schemas: dict[str, int] = {}
        for topic in topics:
            if topic.schema not in schemas:
                schemas[topic.schema] = self._writer.register_schema(
                    topic.schema, topic.schema_encoding, topic.schema_data
                )
            channel = self._writer.register_channel(topic.name, topic.encoding, schemas[topic.schema], {"epoch": epoch})
            self._channels[topic.name] = channel
            self._builder.index.topics.append(TopicEntry(channel, topic.name, topic.schema, topic.encoding))

    @property
    def head(self) -> str:
        """The head of the chain, as far as it is signed; "" without signatures."""
        return "" if self._signatures is None else self._signatures.head

    @property
    def bytes_written(self) -> int:
        return self._whole

    @property
    def lost(self) -> int:
        return self._builder.index.lost

    def count_lost(self, count: int) -> None:
        """Count records that were left out."""
        self._builder.index.lost += count

    def index(self) -> EventIndex:
        """Return a copy of the index of the chunks in the file."""
        return self._builder.written()

    def write(self, entry: Entry) -> None:
        """Put an entry into the chunk. An entry of a topic that the file lacks is left out, and counted as lost."""
        channel = self._channels.get(entry.topic)
        if channel is None:
            self.count_lost(1)
            return
        self._writer.add_message(channel, entry.arrived, entry.data, publish_time=entry.captured, sequence=entry.event)
        self._newest = entry.arrived
        feedback = isinstance(entry.record, FeedbackRecord)
        if self._signatures is not None:
            self._signatures.add(entry.topic, entry.event, entry.arrived, entry.captured, entry.data, feedback=feedback)
        if self._chunk_since is None:
            self._chunk_since = entry.arrived
        self._waiting += len(entry.data)
        micros = entry.arrived // 1000
        self._builder.add(entry.topic, entry.event, micros, keyframe=entry.keyframe, feedback=feedback)
        if isinstance(entry.record, EpisodeRecord):
            self._builder.episode(entry.record, micros)
        if entry.record is not None:
            for mark in self._marks.find(entry.record, micros):
                self._builder.mark(mark)
        if self._waiting >= CHUNK_BYTES:
            self.flush()

    def flush_if_due(self, now: int) -> bool:
        """Put the chunk on the disk, and return True, if its first record is old enough; `now`: ns, as arrivals."""
        if self._chunk_since is None or now - self._chunk_since < CHUNK_SECONDS * 1e9:
            return False
        self.flush()
        return True

    def flush(self, *, final: bool = False) -> None:
        """Put the chunk on the disk."""
        if self._chunk_since is None and not (final and self._signatures is not None):
            return
        try:
            if self._signatures is not None:
                self._sign(self._signatures, final=final)
            self._writer.flush()
            self._builder.chunk_written(self._whole)
            self._sync()
        except OSError as error:
            raise DiskTrouble(_reason(error)) from error
        self._waiting, self._chunk_since = 0, None

    def _sign(self, signatures: Signatures, *, final: bool) -> None:
        """Write the chunk's last message, its signature."""
        record = signatures.sign(final=final)
        data = msgspec.json.encode(record)
        channel = self._channels[SIGNATURE]
        self._writer.add_message(channel, self._newest, data, publish_time=self._newest, sequence=record.event)
        self._builder.add(SIGNATURE, record.event, self._newest // 1000, keyframe=False, feedback=False)

    def _sync(self) -> None:
        self._file.flush()
        os.fdatasync(self._file.fileno())
        self._whole = self._file.tell()

    def close(self, ending: Ending = "") -> EventIndex:
        """Write the last chunk, the index and the summary. Idempotent."""
        if self._file.closed:
            return self._builder.index
        self.flush(final=True)
        index = self._builder.index
        index.ending = ending
        try:
            self._writer.add_attachment(
                0, index.ended * 1000, INDEX_NAME, "application/json", msgspec.json.encode(index)
            )
            self._writer.finish()
            self._sync()
            self._file.close()
        except OSError as error:
            raise DiskTrouble(_reason(error)) from error
        return index

    def abandon(self) -> None:
        """Cut a file for which the disk has no room back to its whole records. Raises nothing.

        `recover` can complete the rest. A file without whole records is deleted.
        """
        with suppress(OSError):
            self._file.close()  # Python's buffered bytes may not fit
        with suppress(OSError):
            if self._whole:
                os.truncate(self.path, self._whole)  # else readers stop at the broken record
            else:
                self.path.unlink()


def _text(topic: Topic) -> TopicText:
    return TopicText(topic.name, topic.encoding, topic.schema, topic.schema_encoding, topic.schema_data)


def _reason(error: OSError) -> str:
    return error.strerror or str(error)
