"""The index of a recording, which finds the chunks of an event. No I/O."""

from collections.abc import Iterator
from typing import Literal

import msgspec

from lockstep.protocol.serial import event_gap, is_newer
from lockstep.server.recording.errors import RecordingDamaged, shortened
from lockstep.server.recording.format.episodes import EpisodeBook, EpisodeEntry
from lockstep.server.recording.format.records import EpisodeRecord, Whole
from lockstep.server.recording.reading.bookmarks import Mark

__all__ = [
    "INDEX_NAME",
    "ChunkEntry",
    "Ending",
    "EventEntry",
    "EventIndex",
    "IndexBuilder",
    "TopicEntry",
    "check_index",
    "decode_index",
]

INDEX_NAME = "lockstep-index.json"
EVENT_SPACING = 100_000  # µs between two events of the index
MAX_MARKS = 20_000
MAX_TOPICS = 128  # the streams of a robot, and Lockstep's own
MAX_TOPIC = 1000  # characters

# How a file has ended: not known (interrupted, or by an earlier version), another part follows, or the recording has
# ended, in which no episode was begun in any part, or one was.
Ending = Literal["", "continued", "no_episodes", "episodes"]


class TopicEntry(msgspec.Struct, frozen=True):
    id: Whole  # MCAP's channel
    topic: str
    schema: str
    encoding: str


class ChunkEntry(msgspec.Struct, array_like=True):
    offset: Whole  # bytes, beginning of the chunk's record
    first_event: Whole  # smallest of its records
    last_event: Whole
    started: Whole  # µs since 1970, arrival of its first record
    ended: Whole


class EventEntry(msgspec.Struct, frozen=True, array_like=True):
    event: Whole
    arrived: Whole  # µs since 1970
    chunk: Whole


class EventIndex(msgspec.Struct, kw_only=True):
    """See docs/recording.md, "The index"."""

    version: Literal[1] = 1
    epoch: str = ""
    recording: str = ""
    part: Whole = 1
    started: Whole = 0
    ended: Whole = 0
    first_event: Whole = 0  # 0: no feedback
    last_event: Whole = 0
    topics: list[TopicEntry] = []
    chunks: list[ChunkEntry] = []
    events: list[EventEntry] = []
    keyframes: dict[str, list[EventEntry]] = {}
    marks: list[Mark] = []
    episodes: list[EpisodeEntry] = []
    counts: dict[str, Whole] = {}
    lost: Whole = 0
    ending: Ending = ""

    def chunks_with(self, first_event: int, last_event: int) -> Iterator[int]:
        """Yield the numbers of the chunks that can hold records of these events."""
        for number, chunk in enumerate(self.chunks):
            if not is_newer(chunk.first_event, last_event) and not is_newer(first_event, chunk.last_event):
                yield number

    def after(self, chunk: int) -> "EventIndex":
        """Return the index with its lists from that chunk on; the rest is unchanged."""
        if chunk == 0:
            return self
        begin = self.chunks[chunk].started if chunk < len(self.chunks) else self.ended + 1
        return msgspec.structs.replace(
            self,
            chunks=self.chunks[chunk:],
            events=[each for each in self.events if each.chunk >= chunk],
            keyframes={
                topic: [each for each in entries if each.chunk >= chunk] for topic, entries in self.keyframes.items()
            },
            marks=[each for each in self.marks if each.time >= begin],
            episodes=[each for each in self.episodes if each.ended >= begin],
        )

    def without_chunks_before(self, chunk: int) -> "EventIndex":
        """Return the index as if it began with that chunk, but with all chunks, so that their numbers stay."""
        later = self.after(chunk)
        events = later.events
        return msgspec.structs.replace(
            later,
            started=self.chunks[chunk].started,
            first_event=events[0].event if events else self.chunks[chunk].first_event,
            chunks=self.chunks,
            counts={},
        )

    def sparse(self, spacing: int) -> "EventIndex":
        """Return the index with events at least `spacing` µs apart, for a reader that loads the chunks anyway."""
        events: list[EventEntry] = []
        for each in self.events:
            if not events or each.arrived - events[-1].arrived >= spacing:
                events.append(each)
        return msgspec.structs.replace(self, events=events)

    def keyframe_before(self, topic: str, event: int) -> EventEntry | None:
        """Return the newest keyframe stamped `event` or earlier, or None."""
        entries = self.keyframes.get(topic, [])
        low, high = 0, len(entries)
        while low < high:
            middle = (low + high) // 2
            if event_gap(entries[middle].event, event) <= 0:
                low = middle + 1
            else:
                high = middle
        # The first of several with that stamp: the pictures of the event begin there.
        while low > 1 and entries[low - 2].event == event:
            low -= 1
        return entries[low - 1] if low else None


_decoder = msgspec.json.Decoder(EventIndex)


def check_index(index: EventIndex) -> None:
    """Check that a page can show the index, whoever made the file. Raises RecordingDamaged."""
    counts = {
        "topics": (len(index.topics), MAX_TOPICS),
        "topics with keyframes": (len(index.keyframes), MAX_TOPICS),
        "topics that are counted": (len(index.counts), MAX_TOPICS),
        "marks": (len(index.marks), MAX_MARKS),
    }
    for kind, (count, most) in counts.items():
        if count > most:
            raise RecordingDamaged(f"the index has {count} {kind}, the bound is {most}")
    if any(len(each.topic) > MAX_TOPIC for each in index.topics):
        raise RecordingDamaged(f"the index has a topic of more than {MAX_TOPIC} characters")


def decode_index(data: bytes) -> EventIndex:
    """Decode an index. Raises RecordingDamaged."""
    try:
        return _decoder.decode(data)
    except (msgspec.DecodeError, UnicodeError, RecursionError) as error:
        raise RecordingDamaged(f"the index cannot be read: {shortened(error)}") from error


class IndexBuilder:
    """Builds the index of a file: `add` every record in the order of the file, `chunk_written` after each chunk."""

    def __init__(self, index: EventIndex) -> None:
        self.index = index
        self._chunk: ChunkEntry | None = None  # the chunk that is being filled
        self._book = EpisodeBook()

    def add(self, topic: str, event: int, arrived: int, *, keyframe: bool, feedback: bool) -> None:
        """Add a record. `arrived`: µs; `keyframe`: it is a picture's keyframe; `feedback`: it is a feedback."""
        index = self.index
        if not index.started:
            index.started = arrived
        index.ended = arrived
        index.counts[topic] = index.counts.get(topic, 0) + 1
        chunk = self._chunk
        if chunk is None:
            chunk = self._chunk = ChunkEntry(0, event, event, arrived, arrived)
        chunk.ended = arrived
        if is_newer(chunk.first_event, event):
            chunk.first_event = event
        elif is_newer(event, chunk.last_event):
            chunk.last_event = event
        if keyframe:
            index.keyframes.setdefault(topic, []).append(EventEntry(event, arrived, len(index.chunks)))
        if feedback:
            self._add_event(event, arrived)

    def _add_event(self, event: int, arrived: int) -> None:
        index = self.index
        if not index.first_event:
            index.first_event = event
        new = event != index.last_event
        index.last_event = event
        if new and (not index.events or arrived - index.events[-1].arrived >= EVENT_SPACING):
            index.events.append(EventEntry(event, arrived, len(index.chunks)))

    def mark(self, mark: Mark) -> None:
        if len(self.index.marks) < MAX_MARKS:
            self.index.marks.append(mark)

    def episode(self, record: EpisodeRecord, arrived: int) -> None:
        """Add a record of an episode, which arrived at `arrived` (µs), besides `add`."""
        self._book.take(record, arrived)
        self.index.episodes = self._book.entries()

    def chunk_written(self, offset: int) -> None:
        """Called when all records added since the last call are in one chunk, at `offset`."""
        if self._chunk is not None:
            self._chunk.offset = offset
            self.index.chunks.append(self._chunk)
            self._chunk = None

    def written(self) -> EventIndex:
        """Return a copy of the index, for the chunks in the file by now. May be called from another thread."""
        index = self.index
        chunks = list(index.chunks)
        ended = chunks[-1].ended if chunks else index.started
        return msgspec.structs.replace(
            index,
            ended=ended,
            chunks=chunks,
            events=[each for each in list(index.events) if each.chunk < len(chunks)],
            keyframes={
                topic: [each for each in list(entries) if each.chunk < len(chunks)]
                for topic, entries in list(index.keyframes.items())
            },
            marks=[each for each in list(index.marks) if each.time <= ended],
            episodes=[each for each in index.episodes if each.ended <= ended],
            counts=dict(index.counts),
        )
