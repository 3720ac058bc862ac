"""What an index says is compared with the records, in files that nobody signed too. The checksums of all fit."""

from collections.abc import Callable
from io import BytesIO
from pathlib import Path

import msgspec
import pytest
from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Channel, ChunkIndex, McapRecord, Message, MessageIndex, Statistics

from lockstep.server.recording.format.event_index import EventIndex
from lockstep.server.recording.reading.raw_records import MAGIC, RawRecord, raw_records
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.recording.reading.scan import complete_file
from lockstep.server.recording.verify.promises import Verdict
from lockstep.server.recording.verify.verify_file import verify_file
from tests.server.recording.makers import INFO, Story
from tests.server.recording.verify.forging import remade

EVENTS = 150


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("recordings") / "a.mcap"
    Story(events=EVENTS).write(path, close=False).close()  # how it ended is not said, as in a completed file
    return path.read_bytes()


@pytest.fixture
def path(whole: bytes, tmp_path: Path) -> Path:
    path = tmp_path / "a.mcap"
    path.write_bytes(whole)
    return path


def troubles(verdict: Verdict) -> list[str]:
    return [each.text for check in verdict.checks.values() for each in check.violations]


def raw_of(record: McapRecord) -> RawRecord:
    builder = RecordBuilder()
    record.write(builder)
    content = builder.end()
    return RawRecord(content[0], 0, content[9:])


def changed(opcode: Opcode, change: Callable[[ReadDataStream], McapRecord | None]) -> Callable[[RawRecord], RawRecord]:
    """Change every record of a kind, except those for which `change` returns None."""

    def of(raw: RawRecord) -> RawRecord:
        record = change(ReadDataStream(BytesIO(raw.content))) if raw.opcode == opcode else None
        return raw if record is None else raw._replace(content=raw_of(record).content)

    return of


def with_entries_swapped(stream: ReadDataStream) -> McapRecord | None:
    found: MessageIndex = MessageIndex.read(stream)
    times, places = zip(*found.records, strict=True)
    found.records = list(zip(times, reversed(places), strict=True))
    return found if len(places) > 1 else None


def with_message_indexes_swapped(stream: ReadDataStream) -> McapRecord:
    found: ChunkIndex = ChunkIndex.read(stream)
    offsets = found.message_index_offsets
    found.message_index_offsets = dict(zip(offsets, reversed(offsets.values()), strict=True))
    return found


def with_fewer_messages(stream: ReadDataStream) -> McapRecord:
    found: Statistics = Statistics.read(stream)
    found.message_count -= 1
    return found


def with_another_topic(stream: ReadDataStream) -> McapRecord | None:
    found: Channel = Channel.read(stream)
    found.topic = found.topic[:-1] + "X"
    return found


def test_a_file_as_it_was_written_has_no_fault(path: Path) -> None:
    assert troubles(verify_file(path)) == []


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (changed(Opcode.MESSAGE_INDEX, with_entries_swapped), "the message index of chunk 0 points to other messages"),
        (
            changed(Opcode.CHUNK_INDEX, with_message_indexes_swapped),
            "the summary leads to other message indexes than the file has",
        ),
        (changed(Opcode.STATISTICS, with_fewer_messages), "the summary counts other messages than the file has"),
        (changed(Opcode.CHANNEL, with_another_topic), "the summary has other topics than the records"),
    ],
)
def test_an_index_for_other_programs_that_leads_elsewhere_is_named(
    path: Path, change: Callable[[RawRecord], RawRecord], named: str
) -> None:
    remade(path, [], change)
    verdict = verify_file(path)
    assert named in [each.text for each in verdict.checks["readable"].violations]
    assert verdict.signature.state == "unsigned"


def test_a_message_outside_of_all_chunks_is_named(path: Path) -> None:
    remade(path, [raw_of(Message(1, 1, b"{}", 1, 1))])
    with path.open("rb") as stream:
        make_reader(stream)  # it is a file that other programs take
    assert any("outside of all chunks and in no index" in each for each in troubles(verify_file(path)))


def with_index(path: Path, change: Callable[[EventIndex], EventIndex]) -> None:
    """Write the story with an index that somebody changed."""
    path.unlink()
    writer = Story(events=EVENTS).write(path, close=False)
    writer.flush(final=True)
    writer._builder.index = change(writer._builder.index)
    writer.close()


def without_a_chunk(index: EventIndex) -> EventIndex:
    return msgspec.structs.replace(index, chunks=[*index.chunks[:2], *index.chunks[3:]])


def without_events_of_a_chunk(index: EventIndex) -> EventIndex:
    chunks = list(index.chunks)
    chunks[2] = msgspec.structs.replace(chunks[2], first_event=chunks[1].first_event, last_event=chunks[1].last_event)
    return msgspec.structs.replace(index, chunks=chunks)


def with_topics_exchanged(index: EventIndex) -> EventIndex:
    one, other, *rest = index.topics
    exchanged = [msgspec.structs.replace(one, id=other.id), msgspec.structs.replace(other, id=one.id)]
    return msgspec.structs.replace(index, topics=[*exchanged, *rest])


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (without_a_chunk, "the index names other chunks than the file has"),
        (without_events_of_a_chunk, "the index gives chunks other events or times than their records have"),
        (with_topics_exchanged, "the index has other topics than the records"),
        (lambda index: msgspec.structs.replace(index, events=[]), "the index has other events than the records"),
        (lambda index: msgspec.structs.replace(index, keyframes={}), "the index has other keyframes than the records"),
    ],
)
def test_an_index_of_lockstep_that_hides_records_is_named_and_the_records_are_judged_all_the_same(
    path: Path, change: Callable[[EventIndex], EventIndex], named: str
) -> None:
    before = verify_file(path)
    with_index(path, change)
    with RecordingReader(path) as reader:
        assert not reader.interrupted
    verdict = verify_file(path)
    assert named in [each.text for each in verdict.checks["readable"].violations]
    assert (verdict.events, verdict.commands) == (before.events, before.commands)
    assert verdict.pictures_and_sounds == before.pictures_and_sounds


def test_a_file_that_was_cut_within_the_message_indexes_of_its_last_chunk_has_them_all_when_it_is_completed(
    whole: bytes, path: Path
) -> None:
    with path.open("rb") as file:
        file.seek(len(MAGIC))
        records = list(raw_records(file))
    number = max(place for place, raw in enumerate(records) if raw.opcode == Opcode.CHUNK)
    indexes = [raw for raw in records[number + 1 :] if raw.opcode == Opcode.MESSAGE_INDEX]
    assert len(indexes) > 3
    for end in (records[number].end, indexes[1].end, indexes[1].end + 5, indexes[-1].end):
        path.write_bytes(whole[:end])
        complete_file(path, INFO)
        assert path.read_bytes() == whole


def test_a_recording_that_is_still_written_is_called_that_and_not_interrupted(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    writer = Story(events=EVENTS).write(path, close=False)
    writer.flush()
    assert troubles(verify_file(path)) == ["the recording is still written and has no end yet"]
    killed = tmp_path / "b.mcap"
    killed.write_bytes(path.read_bytes())
    assert troubles(verify_file(killed)) == ["the recording was interrupted and has no end"]
    writer.close()
    assert troubles(verify_file(path)) == []
