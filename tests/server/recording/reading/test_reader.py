"""What is written is read again, by event; also from files that are not whole."""

from pathlib import Path

import pytest
from mcap.reader import make_reader

from lockstep.protocol.serial import MAX_EVENT
from lockstep.server.recording.errors import RecordingDamaged, RecordingTampered
from lockstep.server.recording.format.records import CommandRecord, FeedbackRecord
from lockstep.server.recording.format.topics import OWN_TOPICS
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.recording.reading.scan import complete_file
from lockstep.server.recording.verify.verify_file import verify_file
from tests.server.recording.makers import DESCRIPTION, INFO, SECOND, START, Story

COMMAND, FEEDBACK = OWN_TOPICS[CommandRecord], OWN_TOPICS[FeedbackRecord]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "a.mcap"
    Story(events=200, force_at=60).write(path)
    return path


def test_everything_of_one_event_is_found_by_its_number(file: Path) -> None:
    with RecordingReader(file) as reader:
        found = list(reader.records(60, 60))
        assert {record.topic for record in found} >= {COMMAND, FEEDBACK, "/camera/front", "/microphone/ear", "/wrench"}
        assert {record.event for record in found} == {60}
        picture = next(record for record in found if record.topic == "/camera/front")
        assert picture.payload[-4:] == (59).to_bytes(4, "big")
        assert picture.captured == START + 59 * SECOND // 25 + 1_000_000
        assert picture.arrived == START + 59 * SECOND // 25 + 5_000_000


def test_pictures_that_can_be_decoded_begin_with_a_keyframe_at_or_before_the_event(file: Path) -> None:
    with RecordingReader(file) as reader:
        found = list(reader.records(60, 62, {"/camera/front"}, decodable=True))
        assert [record.event for record in found] == list(range(52, 63))
        assert [record.keyframe for record in found] == [True] + [False] * 10


def test_pictures_in_vp8_say_so_and_are_found_from_their_keyframe_also_after_an_interruption(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    Story(events=120, real=True, codecs=("H264", "VP8")).write(path)
    with RecordingReader(path) as reader:
        index = reader.index
        found = list(reader.records(60, 62, {"/camera/front"}, decodable=True))
        assert [record.event for record in found] == list(range(52, 63))
        pictures = [record.picture for record in found]
    assert [(each.format, each.keyframe) for each in pictures if each] == [("vp8", True)] + [("vp8", False)] * 10
    path.write_bytes(path.read_bytes()[:-1])
    with RecordingReader(path) as reader:
        assert reader.interrupted
        assert reader.index.keyframes == index.keyframes


def test_sound_says_of_each_packet_in_which_codec_it_is_also_after_an_interruption(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    Story(events=101, real=True, sounds=("opus", "PCMU")).write(path)
    verdict = verify_file(path)
    assert (verdict.ok, verdict.pictures_and_sounds) == (True, 300)
    with RecordingReader(path) as reader:
        index = reader.index
    path.write_bytes(path.read_bytes()[:-1])
    with RecordingReader(path) as reader:
        assert reader.interrupted
        assert (reader.index.topics, reader.index.counts) == (index.topics, index.counts)
        sounds = [record.sound for record in reader.records(50, 53, {"/microphone/ear"})]
    assert [each.format for each in sounds if each] == ["opus"] * 4 + ["g711-ulaw"] * 4
    assert [len(each.data) for each in sounds if each][4:] == [160] * 4


def test_the_index_has_the_description_the_marks_and_no_more_than_a_second_in_a_chunk(file: Path) -> None:
    with RecordingReader(file) as reader:
        assert reader.info == INFO
        assert reader.description() == DESCRIPTION
        assert (reader.index.first_event, reader.index.last_event) == (1, 200)
        assert [(mark.kind, mark.event) for mark in reader.index.marks] == [("contact", 61)]
        assert all(chunk.ended - chunk.started <= 1_000_000 for chunk in reader.index.chunks)
        assert not reader.interrupted


def test_the_mcap_library_reads_the_file_and_its_checksums_fit(file: Path) -> None:
    with file.open("rb") as stream, RecordingReader(file) as reader:
        mcap = make_reader(stream, validate_crcs=True)
        summary = mcap.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        messages = list(mcap.iter_messages())
        assert len(messages) == summary.statistics.message_count == sum(reader.index.counts.values())
        feedback = next(message for _, channel, message in messages if channel.topic == FEEDBACK)
        assert (feedback.sequence, feedback.log_time) == (1, START)
        assert all(channel.metadata == {"epoch": INFO.epoch} for channel in summary.channels.values())


def test_events_are_found_where_their_numbers_wrap(tmp_path: Path) -> None:
    path = tmp_path / "wrap.mcap"
    Story(first_event=MAX_EVENT - 40, events=100).write(path)
    with RecordingReader(path) as reader:
        found = [record.event for record in reader.records(MAX_EVENT - 1, 2, {FEEDBACK})]
        assert found == [MAX_EVENT - 1, MAX_EVENT, 1, 2]


@pytest.mark.parametrize("share", [0.3, 0.6, 0.9])
def test_an_interrupted_file_opens_and_is_completed_as_far_as_it_is_whole(file: Path, share: float) -> None:
    data = file.read_bytes()
    file.write_bytes(data[: int(len(data) * share)])
    with RecordingReader(file) as reader:
        assert reader.interrupted
        before = reader.index
        assert 1 < before.last_event <= 200
    complete_file(file, INFO)
    with RecordingReader(file) as reader, file.open("rb") as stream:
        assert not reader.interrupted
        assert reader.index == before
        assert sum(1 for _ in make_reader(stream, validate_crcs=True).iter_messages()) == sum(before.counts.values())
        assert list(reader.records(before.last_event, before.last_event, {FEEDBACK}))


def test_a_file_that_was_not_closed_has_all_but_the_last_second(tmp_path: Path) -> None:
    path = tmp_path / "open.mcap"
    writer = Story(events=101).write(path, close=False)
    with RecordingReader(path, writer.index()) as running, RecordingReader(path) as found:
        assert found.interrupted
        assert running.index.chunks == found.index.chunks
        assert found.index.last_event >= 101 - 25
    writer.close()


def test_a_changed_byte_shows(file: Path) -> None:
    with RecordingReader(file) as reader:
        offset = reader.index.chunks[3].offset + 2000
    with file.open("r+b") as stream:
        stream.seek(offset)
        byte = stream.read(1)
        stream.seek(offset)
        stream.write(bytes([byte[0] ^ 1]))
    with RecordingReader(file) as reader, pytest.raises((RecordingTampered, RecordingDamaged)):
        list(reader.chunk(3))


@pytest.mark.parametrize("content", [b"", b"hello", b"\x89MCAP0\r\n", b"\x89MCAP0\r\n" + b"\xff" * 100])
def test_what_is_no_recording_is_refused_by_name(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "x.mcap"
    path.write_bytes(content)
    with pytest.raises(RecordingDamaged):
        RecordingReader(path)
