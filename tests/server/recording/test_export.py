"""Exports, read by what others wrote: PyAV, pyarrow, csv, and a checker of LeRobot datasets."""

import csv
import json
from pathlib import Path

import av
import numpy as np
import pyarrow.parquet as pq
import pytest
from foxglove_schemas_protobuf.RawAudio_pb2 import RawAudio

from lockstep.server.recording.errors import RecordingDamaged
from lockstep.server.recording.export import export_csv, export_lerobot, export_mp4, export_parquet
from lockstep.server.recording.format.foxglove import sound_message
from lockstep.server.recording.format.payload import sound_of
from lockstep.server.recording.format.records import Degraded
from lockstep.server.recording.format.topics import CAMERA, MICROPHONE
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.recording.writing.writer import RecordingWriter
from tests.server.recording.graders import doctor_counts
from tests.server.recording.makers import CODECS, DESCRIPTION, EPOCH, INFO, INTERVAL, START, Story, own_entry, rewritten

EVENTS = 60


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recordings") / "a.mcap"
    Story(events=EVENTS, force_at=20, real=True).write(path)
    return path


def brightness(frame: av.VideoFrame) -> float:
    return float(frame.to_ndarray(format="gray")[100:140, 100:220].mean())


def test_mp4_has_the_same_pictures_and_sound_and_not_encoded_again(file: Path, tmp_path: Path) -> None:
    (target,) = export_mp4.export(file, tmp_path / "a.mp4", "")
    with av.open(str(target)) as video:
        picture, sound = video.streams.video[0], video.streams.audio[0]
        assert (picture.codec_context.name, sound.codec_context.name) == ("h264", "opus")
        pictures = [packet for packet in video.demux(picture) if packet.size]
        assert len(pictures) == EVENTS - 1
        assert [packet.is_keyframe for packet in pictures].count(True) == 2
        base = picture.time_base or 1
        times = [float((packet.pts or 0) * base) for packet in pictures]
        assert times == pytest.approx([0.04 * number + times[0] for number in range(EVENTS - 1)], abs=0.001)
    with av.open(str(target)) as video:
        frames = [brightness(frame) for frame in video.decode(video=0)]
        assert len(frames) == EVENTS - 1
        assert frames[0] == pytest.approx(4, abs=4)
        assert frames[-1] == pytest.approx(2 * EVENTS, abs=6)
    with av.open(str(target)) as video:
        samples = sum(frame.samples for frame in video.decode(audio=0))
        assert samples >= (2 * (EVENTS - 1) - 2) * 960


@pytest.mark.parametrize("codecs", [("H264",), ("H264", "VP8")])
def test_mp4_has_no_picture_that_builds_on_one_that_was_left_out(codecs: tuple[str, ...], tmp_path: Path) -> None:
    """Keyframes are those of events 2 and 52; something was left out before the picture of event 40."""
    lost = own_entry(Degraded(epoch=EPOCH, event=40, lost=3), START + 39 * INTERVAL + 4_000_000)
    entries = sorted([*Story(events=EVENTS, real=True, codecs=codecs).entries(), lost], key=lambda each: each.arrived)
    path = rewritten(tmp_path / "a.mcap", entries, lambda each: [each])
    (target,) = export_mp4.export(path, tmp_path / "a.mp4", "")
    with av.open(str(target)) as video:
        frames = [brightness(frame) for frame in video.decode(video=0)]
    assert frames == pytest.approx([2.0 * event for event in [*range(2, 40), *range(52, EVENTS + 1)]], abs=8)


@pytest.mark.parametrize("codecs", [("VP8",), ("H264", "VP8")])
def test_pictures_in_vp8_are_encoded_for_mp4_and_lerobot_all_of_them(codecs: tuple[str, ...], tmp_path: Path) -> None:
    """Also where the codec changed on the way."""
    path = tmp_path / "a.mcap"
    Story(events=EVENTS, real=True, codecs=codecs).write(path)
    (target,) = export_mp4.export(path, tmp_path / "a.mp4", "")
    with av.open(str(target)) as video:
        assert [each.codec_context.name for each in video.streams] == ["h264", "opus"]
        shown = [brightness(frame) for frame in video.decode(video=0)]
    assert shown == pytest.approx([2 * event for event in range(2, EVENTS + 1)], abs=6)
    (root,) = export_lerobot.export(path, tmp_path / "dataset", "")
    events = pq.read_table(root / "data" / "chunk-000" / "file-000.parquet").column("lockstep.event").to_pylist()
    assert events == list(range(2, EVENTS))
    with av.open(str(root / "videos" / "observation.images.front" / "chunk-000" / "file-000.mp4")) as video:
        shown = [brightness(frame) for frame in video.decode(video=0)]
    assert shown == pytest.approx([2 * event for event in events], abs=6)


def test_mp4_has_g711_sound_as_aac_with_silence_where_packets_are_missing(tmp_path: Path) -> None:
    source, rate, gap = tmp_path / "a.mcap", 8000, range(20, 40)  # 0.8 s
    tone = (12_000 * np.sin(np.arange(160) * 2 * np.pi * 400 / rate)).astype(np.int16)
    (packet,) = mulaw(tone)
    entries = [
        each._replace(data=sound_message("g711-ulaw", each.captured, packet))
        if each.topic == MICROPHONE + "ear"
        else each
        for each in Story(events=EVENTS, real=True).entries()
        if each.topic != MICROPHONE + "ear" or each.event not in gap
    ]
    writer = RecordingWriter(source, INFO, DESCRIPTION, CODECS | {"ear": "PCMU"})
    for each in entries:
        writer.write(each)
    writer.close()
    (target,) = export_mp4.export(source, tmp_path / "a.mp4", "")
    with av.open(str(target)) as video:
        assert video.streams.audio[0].codec_context.name == "aac"
        heard = np.concatenate([frame.to_ndarray().ravel() for frame in video.decode(audio=0)])
    levels = [float(np.abs(heard[at : at + 800]).max()) for at in range(0, len(heard) - 800, 800)]  # tenths of seconds
    assert len(heard) / rate == pytest.approx((EVENTS - 1) * 0.04, abs=0.2)
    assert min(levels[2:6]) > 0.3
    assert max(levels[9:15]) < 0.02
    assert min(levels[17:-1]) > 0.3


def test_mp4_has_sound_in_both_codecs_as_opus_all_of_it_and_opus_as_it_is(tmp_path: Path) -> None:
    """A recording in which the codec of the sound changed on the way, twice."""
    source = tmp_path / "a.mcap"
    Story(events=151, real=True, sounds=("opus", "PCMU", "opus")).write(source)
    with RecordingReader(source) as reader:
        sounds = [found for each in reader.records(topics=[MICROPHONE + "ear"]) if (found := each.sound)]
    assert [each.format for each in sounds] == ["opus"] * 100 + ["g711-ulaw"] * 100 + ["opus"] * 100
    (target,) = export_mp4.export(source, tmp_path / "a.mp4", "")
    with av.open(str(target)) as video:
        packets = [bytes(packet) for packet in video.demux(video.streams.audio[0]) if packet.size]
    assert len(packets) == 300
    assert packets[:100] + packets[200:] == [each.data for each in sounds if each.format == "opus"]
    with av.open(str(target)) as video:
        assert video.streams.audio[0].codec_context.name == "opus"
        frames = [frame.to_ndarray().ravel() for frame in video.decode(audio=0)]
    levels = [float(np.abs(frame).max()) for frame in frames[5:-5]]
    assert min(levels) > 0.1
    heard = np.concatenate(frames[120:180])  # what was G.711
    strongest = np.abs(np.fft.rfft(heard)).argmax() * 48_000 / len(heard)
    assert strongest == pytest.approx(400, abs=5)


def test_g711_of_earlier_files_is_read(tmp_path: Path) -> None:
    """It was in Foxglove's RawAudio."""
    message = RawAudio(data=b"\xff" * 160, format="g711-ulaw", sample_rate=8000, number_of_channels=1)
    found = sound_of("foxglove.RawAudio", message.SerializeToString())
    assert found == ("g711-ulaw", b"\xff" * 160)


def mulaw(samples: np.typing.NDArray[np.int16]) -> list[bytes]:
    encoder = av.CodecContext.create("pcm_mulaw", "w")
    encoder.sample_rate, encoder.layout, encoder.format = 8000, "mono", "s16"
    frame = av.AudioFrame.from_ndarray(samples.reshape(1, -1), format="s16", layout="mono")
    frame.sample_rate = 8000
    return [bytes(packet) for packet in encoder.encode(frame)]


def test_mp4_of_a_recording_without_pictures_is_refused_by_name(tmp_path: Path) -> None:
    entries = Story(events=5).entries()
    path = rewritten(tmp_path / "a.mcap", entries, lambda entry: [] if entry.topic.startswith(CAMERA) else [entry])
    with pytest.raises(RecordingDamaged, match="no pictures"):
        export_mp4.export(path, None, "")


def test_csv_has_a_row_for_each_event_with_its_command(file: Path, tmp_path: Path) -> None:
    (target,) = export_csv.export(file, tmp_path / "a.csv", "")
    with target.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [int(row["event"]) for row in rows] == list(range(1, EVENTS + 1))
    assert rows[0]["command.base.vx"] == ""
    assert float(rows[30]["command.base.vx"]) == pytest.approx(30 / EVENTS)
    assert (rows[30]["driver"], rows[30]["stamp.front"], rows[30]["gap.front"]) == ("Ada", "30", "1")


def test_parquet_has_the_same_table_with_types(file: Path, tmp_path: Path) -> None:
    (target,) = export_parquet.export(file, tmp_path / "a.parquet", "")
    table = pq.read_table(target)
    assert table.num_rows == EVENTS
    assert table.column("event").to_pylist() == list(range(1, EVENTS + 1))
    assert table.column("command.base.vx")[0].as_py() is None
    assert table.column("wrench.fx")[20].as_py() == 5.0
    assert table.schema.metadata[b"lockstep.epoch"] == b"epoch-1"


def test_a_lerobot_dataset_pairs_each_event_with_the_command_that_answered_it_and_its_picture(
    file: Path, tmp_path: Path
) -> None:
    (root,) = export_lerobot.export(file, tmp_path / "dataset", "push the box")
    info = json.loads((root / "meta" / "info.json").read_text())
    table = pq.read_table(root / "data" / "chunk-000" / "file-000.parquet")
    events = table.column("lockstep.event").to_pylist()
    assert info["total_frames"] == table.num_rows == len(events)
    assert events == list(range(2, EVENTS))  # the first has no picture, the last no answer
    states, actions = table.column("observation.state").to_pylist(), table.column("action").to_pylist()
    names = info["features"]["observation.state"]["names"]
    assert [state[names.index("x.pos")] for state in states] == [event - 1 for event in events]
    assert [action[0] for action in actions] == pytest.approx([event / EVENTS for event in events])
    with av.open(str(root / "videos" / "observation.images.front" / "chunk-000" / "file-000.mp4")) as video:
        shown = [brightness(frame) for frame in video.decode(video=0)]
    assert shown == pytest.approx([2 * event for event in events], abs=6)
    tasks = pq.read_table(root / "meta" / "tasks.parquet")
    assert tasks.column("task").to_pylist() == ["push the box"]


def test_a_checker_that_others_wrote_takes_the_lerobot_dataset(file: Path, tmp_path: Path) -> None:
    (root,) = export_lerobot.export(file, tmp_path / "dataset", "push the box")
    counts = doctor_counts(root)
    assert counts["FAIL"] == 0, counts
    assert counts["PASS"] >= 5, counts
