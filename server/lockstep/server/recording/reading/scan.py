"""Reads an interrupted file from its beginning, as far as it is whole, and completes it."""

import os
import struct
import zlib
from io import BytesIO
from pathlib import Path

import msgspec
from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    McapRecord,
    Message,
    MessageIndex,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from lockstep.protocol.files.regular_file import open_regular
from lockstep.server.recording.errors import DiskTrouble, RecordingDamaged
from lockstep.server.recording.format.event_index import INDEX_NAME, EventIndex, IndexBuilder, TopicEntry
from lockstep.server.recording.format.info import METADATA_NAME, RecordingInfo
from lockstep.server.recording.format.payload import VIDEO, own_record_of, picture_of
from lockstep.server.recording.format.records import Degraded, EpisodeRecord, FeedbackRecord
from lockstep.server.recording.reading.bookmarks import BookmarkFinder
from lockstep.server.recording.reading.raw_records import (
    BROKEN,
    HEAD,
    MAGIC,
    RawRecord,
    chunk_records,
    message_indexes,
    raw_records,
)

__all__ = ["Scan", "complete_file", "scan_file", "statistics_of"]


class Scan:
    """The whole records of a file."""

    def __init__(self, info: RecordingInfo) -> None:
        self.index = EventIndex(epoch=info.epoch, recording=info.recording, part=info.part)
        self.whole = len(MAGIC)  # bytes that are whole
        self.ended = False  # a record followed that stands behind the data alone
        self.last_chunk: Chunk | None = None
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.chunks: list[ChunkIndex] = []
        self.metadata: list[MetadataIndex] = []
        self.counts: dict[int, int] = {}  # of messages, by channel
        self._builder = IndexBuilder(self.index)
        self._marks = BookmarkFinder()

    def take(self, raw: RawRecord) -> bool:
        """Take the next record of the file; False when nothing after it counts."""
        stream = ReadDataStream(BytesIO(raw.content))
        if raw.opcode == Opcode.CHUNK:
            self._chunk(raw, Chunk.read(stream))
        elif raw.opcode == Opcode.MESSAGE_INDEX and self.chunks:
            self._message_index(raw, MessageIndex.read(stream))
        elif raw.opcode == Opcode.METADATA:
            self.metadata.append(MetadataIndex(raw.offset, HEAD + len(raw.content), METADATA_NAME))
        elif raw.opcode != Opcode.HEADER:
            self.ended = True
            return False  # the file was about to be closed
        self.whole = raw.end
        return True

    def _chunk(self, raw: RawRecord, chunk: Chunk) -> None:
        parts = chunk_records(chunk)
        self.last_chunk = chunk
        self.chunks.append(
            ChunkIndex(
                chunk_length=HEAD + len(raw.content),
                chunk_start_offset=raw.offset,
                compression=chunk.compression,
                compressed_size=len(chunk.data),
                message_end_time=chunk.message_end_time,
                message_index_length=0,
                message_index_offsets={},
                message_start_time=chunk.message_start_time,
                uncompressed_size=chunk.uncompressed_size,
            )
        )
        for part in parts:
            if isinstance(part, Schema):
                self.schemas[part.id] = part
            elif isinstance(part, Channel):
                self.channels[part.id] = part
                schema = self.schemas[part.schema_id]
                self.index.topics.append(TopicEntry(part.id, part.topic, schema.name, part.message_encoding))
            elif isinstance(part, Message):
                self._message(part)
        self._builder.chunk_written(raw.offset)

    def _message(self, message: Message) -> None:
        self.counts[message.channel_id] = self.counts.get(message.channel_id, 0) + 1
        channel = self.channels[message.channel_id]
        schema = self.schemas[channel.schema_id].name
        keyframe = schema == VIDEO and picture_of(message.data).keyframe
        record = own_record_of(schema, message.data)
        micros = message.log_time // 1000
        feedback = isinstance(record, FeedbackRecord)
        self._builder.add(channel.topic, message.sequence, micros, keyframe=keyframe, feedback=feedback)
        if isinstance(record, Degraded):
            self.index.lost += record.lost
        if isinstance(record, EpisodeRecord):
            self._builder.episode(record, micros)
        if record is not None:
            for mark in self._marks.find(record, micros):
                self._builder.mark(mark)

    def _message_index(self, raw: RawRecord, found: MessageIndex) -> None:
        chunk = self.chunks[-1]
        chunk.message_index_offsets[found.channel_id] = raw.offset
        chunk.message_index_length += HEAD + len(raw.content)


def scan_file(path: Path, info: RecordingInfo) -> Scan:
    """Read the whole records of a file, from its beginning on.

    Raises:
        RecordingDamaged: none is whole.
        OSError: it cannot be read.
    """
    scan = Scan(info)
    with open_regular(path) as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise RecordingDamaged(f"{path.name} is not an MCAP file")
        try:
            for raw in raw_records(file):
                if not scan.take(raw):
                    break
        except (*BROKEN, RecordingDamaged):
            pass  # the rest of the file is broken
    return scan


def complete_file(path: Path, info: RecordingInfo) -> EventIndex:
    """Cut off the broken end of a file, and write the index and the summary behind the rest.

    Raises:
        RecordingDamaged, OSError: as `scan_file`.
        DiskTrouble: there is no room for it.
    """
    scan = scan_file(path, info)
    if not scan.chunks:
        raise RecordingDamaged(f"{path.name} has no records")
    try:
        with path.open("r+b") as file:
            indexes = _indexes_of_last_chunk(scan)
            file.truncate(scan.whole)
            file.seek(scan.whole)
            scan.whole += len(indexes)
            file.write(indexes + _ending(scan))
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        raise DiskTrouble(error.strerror or str(error)) from error
    return scan.index


def _indexes_of_last_chunk(scan: Scan) -> bytes:
    """Return the message indexes of the last chunk if the file was cut within them, and leave them out of the scan.

    Other programs find no message that is in none.
    """
    entry, chunk = scan.chunks[-1], scan.last_chunk
    end = entry.chunk_start_offset + entry.chunk_length
    if chunk is None or scan.whole != end + entry.message_index_length:
        return b""
    indexes = message_indexes(chunk)
    if set(entry.message_index_offsets) == {each.channel_id for each in indexes}:
        return b""
    scan.whole = end
    entry.message_index_offsets = {}
    builder = RecordBuilder()
    for each in indexes:
        entry.message_index_offsets[each.channel_id] = end + builder.count
        each.write(builder)
    entry.message_index_length = builder.count
    found: bytes = builder.end()
    return found


def _ending(scan: Scan) -> bytes:
    """Return all that follows the last chunk of a closed file (MCAP specification, "Summary Section")."""
    builder = RecordBuilder()
    data = msgspec.json.encode(scan.index)
    attachment = Attachment(0, scan.index.ended * 1000, INDEX_NAME, "application/json", data)
    attachment.write(builder)
    attachment_length = builder.count
    DataEnd(0).write(builder)
    behind = builder.end()
    start = scan.whole + len(behind)
    index = AttachmentIndex(
        offset=scan.whole,
        length=attachment_length,
        log_time=attachment.log_time,
        create_time=0,
        data_size=len(data),
        name=INDEX_NAME,
        media_type="application/json",
    )
    groups: list[tuple[Opcode, list[McapRecord]]] = [
        (Opcode.SCHEMA, list(scan.schemas.values())),
        (Opcode.CHANNEL, list(scan.channels.values())),
        (Opcode.STATISTICS, [statistics_of(scan)]),
        (Opcode.CHUNK_INDEX, list(scan.chunks)),
        (Opcode.ATTACHMENT_INDEX, [index]),
        (Opcode.METADATA_INDEX, list(scan.metadata)),
    ]
    summary = RecordBuilder()
    offsets = []
    for opcode, records in groups:
        begin = summary.count
        for record in records:
            record.write(summary)
        offsets.append(SummaryOffset(opcode, start + begin, summary.count - begin))
    offset_start = start + summary.count
    for offset in offsets:
        offset.write(summary)
    text = summary.end()
    crc = zlib.crc32(struct.pack("<BQQQ", Opcode.FOOTER, 20, start, offset_start), zlib.crc32(text))
    footer = RecordBuilder()
    Footer(summary_start=start, summary_offset_start=offset_start, summary_crc=crc).write(footer)
    ending: bytes = behind + text + footer.end() + MAGIC
    return ending


def statistics_of(scan: Scan) -> Statistics:
    """Return the statistics that the summary has to have."""
    return Statistics(
        attachment_count=1,
        channel_count=len(scan.channels),
        channel_message_counts=dict(scan.counts),
        chunk_count=len(scan.chunks),
        message_count=sum(scan.counts.values()),
        message_end_time=max(chunk.message_end_time for chunk in scan.chunks),
        message_start_time=min(chunk.message_start_time for chunk in scan.chunks),
        metadata_count=len(scan.metadata),
        schema_count=len(scan.schemas),
    )
