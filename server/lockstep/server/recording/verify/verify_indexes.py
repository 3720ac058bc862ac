"""Compares what the indexes of a recording say with its records. No I/O.

A file has four: Lockstep's own index, by which its readers find records, and, for other programs, a message index
behind each chunk, an index of chunks and statistics in the summary. The records are true, and an index that differs
from what they make of it is a fault, in a file with signatures and in one without.
"""

from io import BytesIO

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, ChunkIndex, MessageIndex, Schema, Statistics

from lockstep.server.recording.format.event_index import EventIndex
from lockstep.server.recording.reading.raw_records import BROKEN, RawRecord, message_indexes
from lockstep.server.recording.reading.scan import Scan, statistics_of

__all__ = ["IndexChecker"]

# Chunks are compared apart; only the index counts records left out, and says how the file ended.
NOT_COMPARED = ("version", "chunks", "lost", "ending")


class IndexChecker:
    """Checks the indexes: `take` each raw record in the order of the file, then `compare`. Both return the faults.

    Args:
        index: Lockstep's own index in the file; None: it was interrupted and has none
    """

    def __init__(self, index: EventIndex | None) -> None:
        self._index = index
        self._chunks: list[int] = []  # offsets
        # Times of the first and last message, as each chunk says; None: it cannot be read.
        self._spans: list[tuple[int, int] | None] = []
        # Messages of the last chunk, by channel, that no message index has named yet; None: it could not be read.
        self._waiting: dict[int, list[tuple[int, int]]] | None = {}
        self._behind_data = False
        self._chunk_indexes: list[ChunkIndex] = []  # this and the following are the summary's
        self._statistics: list[Statistics] = []
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}

    def take(self, raw: RawRecord) -> list[str]:
        """Take a record. Raises one of BROKEN when an index cannot be read."""
        stream = ReadDataStream(BytesIO(raw.content))
        match raw.opcode:
            case Opcode.CHUNK:
                faults = self._end_chunk()
                self._chunks.append(raw.offset)
                self._spans.append(None)
                self._waiting = None
                return faults + self._chunk(Chunk.read(stream))
            case Opcode.MESSAGE_INDEX:
                return self._message_index(MessageIndex.read(stream))
            case Opcode.MESSAGE:
                return [f"a message at byte {raw.offset} is outside of all chunks and in no index"]
            case Opcode.DATA_END:
                self._behind_data = True
                return self._end_chunk()
            case Opcode.CHUNK_INDEX:
                self._chunk_indexes.append(ChunkIndex.read(stream))
            case Opcode.STATISTICS:
                self._statistics.append(Statistics.read(stream))
            case Opcode.SCHEMA:
                schema = Schema.read(stream)
                self._schemas[schema.id] = schema
            case Opcode.CHANNEL:
                channel = Channel.read(stream)
                self._channels[channel.id] = channel
        return []

    def _chunk(self, chunk: Chunk) -> list[str]:
        self._spans[-1] = said = (chunk.message_start_time, chunk.message_end_time)
        try:
            self._waiting = {each.channel_id: each.records for each in message_indexes(chunk)}
        except BROKEN:
            return []  # who reads its messages says so
        times = [time for found in self._waiting.values() for time, _ in found]
        if times and said != (min(times), max(times)):
            return [f"chunk {len(self._chunks) - 1} gives another time than its messages have"]
        return []

    def _message_index(self, found: MessageIndex) -> list[str]:
        if self._waiting is None or self._waiting.pop(found.channel_id, []) == found.records:
            return []
        return [f"the message index of chunk {len(self._chunks) - 1} points to other messages"]

    def _end_chunk(self) -> list[str]:
        missing, self._waiting = self._waiting, {}
        return [f"chunk {len(self._chunks) - 1} has messages that no message index has"] if missing else []

    def compare(self, scan: Scan) -> list[str]:
        """Compare the indexes with those that the records make: `scan`, of the same file."""
        faults = []
        if self._index is not None:
            faults = [
                f"the index has other {name.replace('_', ' ')} than the records"
                for name in self._index.__struct_fields__
                if name not in NOT_COMPARED and getattr(self._index, name) != getattr(scan.index, name)
            ]
            faults += self._compare_chunks(self._index, scan)
        if self._behind_data:
            faults += self._compare_chunk_indexes(scan)
            if scan.ended:
                faults += self._compare_summary(scan)
        return faults

    def _compare_chunks(self, index: EventIndex, scan: Scan) -> list[str]:
        if [chunk.offset for chunk in index.chunks] != self._chunks:
            return ["the index names other chunks than the file has"]
        if scan.ended and index.chunks != scan.index.chunks:
            return ["the index gives chunks other events or times than their records have"]
        return []

    def _compare_chunk_indexes(self, scan: Scan) -> list[str]:
        said = self._chunk_indexes
        if [each.chunk_start_offset for each in said] != self._chunks:
            return ["the summary names other chunks than the file has"]
        times = [(each.message_start_time, each.message_end_time) for each in said]
        if any(span not in (None, time) for span, time in zip(self._spans, times, strict=True)):
            return ["the summary gives chunks another time than their messages have"]
        if scan.ended and said != scan.chunks:
            return ["the summary leads to other message indexes than the file has"]
        return []

    def _compare_summary(self, scan: Scan) -> list[str]:
        faults = []
        if self._statistics != [statistics_of(scan)]:
            faults.append("the summary counts other messages than the file has")
        if self._schemas != scan.schemas or self._channels != scan.channels:
            faults.append("the summary has other topics than the records")
        return faults
