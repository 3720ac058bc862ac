"""The thread that writes: parts, epochs, what the disk does, and what is left out."""

import errno
import os
import shutil
import threading
from pathlib import Path
from typing import Any

import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from lockstep.protocol.messages import Feedback
from lockstep.server.evidence.signer import Signer
from lockstep.server.recording.format.info import RecordingInfo
from lockstep.server.recording.format.payload import own_record
from lockstep.server.recording.format.records import RobotRecord, SeatRecord, SignatureRecord
from lockstep.server.recording.format.signature import RecordingSigning
from lockstep.server.recording.format.topics import SIGNATURE
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.recording.settings import RecordingSettings
from lockstep.server.recording.verify.verify_file import verify_file
from lockstep.server.recording.writing import recording_queue
from lockstep.server.recording.writing.queue_items import FeedbackItem, MediaItem, OwnItem, RobotItem
from lockstep.server.recording.writing.writer_thread import RecordingThread
from tests.server.recording.makers import CODECS, DESCRIPTION, EPOCH, SECOND, START
from tests.waiting import PATIENCE


class Made:
    """A thread whose recording's clock stands where the newest item was put."""

    def __init__(self, directory: Path, **settings: Any) -> None:
        self.now = START
        self.ended = threading.Event()
        self.parts = 0
        self.thread = RecordingThread(
            directory,
            RecordingSettings(**({"free_bytes": 0} | settings)),
            RecordingInfo(recording="r"),
            lambda: self.now,
            self._part,
            self.ended.set,
            RecordingSigning(Signer(Ed25519PrivateKey.generate()), lambda: ""),
        )

    def _part(self) -> None:
        self.parts += 1

    def robot(self, epoch: str = EPOCH) -> None:
        record = RobotRecord(epoch=epoch, event=1, link="up", description=DESCRIPTION)
        self.thread.queue.put(RobotItem(self.now, record, CODECS))

    def feedback(self, event: int, epoch: str = EPOCH) -> None:
        feedback = Feedback(event=event, issue=1, time=float(event), axes=[0.0, 0.0], joints=[1.0, 2.0, 3.0])
        self.thread.queue.put(FeedbackItem(self.now, self.now, epoch, feedback))

    def picture(self, event: int, size: int = 1000) -> None:
        data = b"\0\0\0\1\x65" + os.urandom(size)
        self.thread.queue.put(MediaItem(self.now, self.now, EPOCH, "front", "H264", event, True, data))

    def pass_second(self) -> None:
        self.now += SECOND


def test_a_part_begins_with_what_holds(tmp_path: Path) -> None:
    made = Made(tmp_path)
    seat = SeatRecord(epoch="", event=1, holder="p1", name="Ada")
    made.thread.queue.put(OwnItem(made.now, seat))  # before the robot was reached
    made.feedback(7)
    made.robot()
    made.thread.start()
    made.thread.close()
    with RecordingReader(tmp_path / "r.mcap") as reader:
        topics = [record.topic for record in reader.records()]
        assert topics[:2] == ["/lockstep/robot", "/log"]
        assert "/lockstep/seat" in topics
        assert (reader.index.first_event, reader.index.last_event) == (7, 7)
        assert {record.event for record in reader.records()} == {7}
    assert made.parts == 1


def test_another_epoch_begins_another_file_and_late_records_of_the_old_one_belong_into_none(tmp_path: Path) -> None:
    made = Made(tmp_path)
    made.robot()
    made.feedback(5)
    made.robot("epoch-2")
    made.feedback(6)
    made.feedback(1, "epoch-2")
    made.thread.start()
    made.thread.close()
    with RecordingReader(tmp_path / "r.mcap") as first, RecordingReader(tmp_path / "r-p2.mcap") as second:
        assert (first.info.epoch, first.index.last_event) == (EPOCH, 5)
        assert (second.info.epoch, second.info.part, second.index.last_event) == ("epoch-2", 2, 1)


def test_a_file_that_is_large_enough_goes_on_in_the_next(tmp_path: Path) -> None:
    made = Made(tmp_path, file_bytes=1_000_000)
    made.robot()
    for event in range(1, 31):
        made.feedback(event)
        made.picture(event, 200_000)
    made.thread.start()
    made.thread.close()
    files = sorted(tmp_path.iterdir())
    assert len(files) == made.parts > 3
    events: list[int] = []
    for number in range(1, len(files) + 1):
        with RecordingReader(tmp_path / ("r.mcap" if number == 1 else f"r-p{number}.mcap")) as reader:
            events += [record.event for record in reader.records(topics={"/camera/front"})]
    assert events == list(range(1, 31))


def test_every_part_is_signed_to_its_end_and_names_the_head_of_the_one_before(tmp_path: Path) -> None:
    made = Made(tmp_path)
    made.robot()
    made.feedback(1)
    made.robot("epoch-2")
    made.feedback(1, "epoch-2")
    made.thread.start()
    made.thread.close()
    first, second = (verify_file(tmp_path / name).signature for name in ("r.mcap", "r-p2.mcap"))
    assert (first.state, second.state, first.previous) == ("signed", "signed", "")
    with RecordingReader(tmp_path / "r.mcap") as reader:
        *_, closing = reader.records(topics={SIGNATURE})
    assert second.previous == own_record(SignatureRecord, closing.data).head


def test_nothing_waits_for_a_disk_that_is_too_slow_and_what_is_missing_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recording_queue, "MAX_WAITING", 10)
    made = Made(tmp_path)
    made.robot()
    for event in range(1, 31):
        made.feedback(event)
    assert made.thread.queue.lost == 21
    made.thread.start()
    made.thread.close()
    with RecordingReader(tmp_path / "r.mcap") as reader:
        assert reader.index.lost == 21
        assert b'"lost":21' in next(iter(reader.records(topics={"/lockstep/degraded"}))).data


def test_what_is_missing_is_told_where_it_is_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The queue fills once more while the thread writes what it has found."""
    monkeypatch.setattr(recording_queue, "MAX_WAITING", 10)
    made = Made(tmp_path)
    real = made.thread.parts.take

    def take(item: Any) -> None:
        real(item)
        if isinstance(item, RobotItem):
            for event in range(1, 21):  # 10 of them find a place
                made.feedback(event)
        elif isinstance(item, FeedbackItem) and item.feedback.event == 10:
            taken.set()

    taken = threading.Event()
    monkeypatch.setattr(made.thread.parts, "take", take)
    made.robot()
    made.thread.start()
    assert taken.wait(PATIENCE)
    made.feedback(21)
    made.thread.close()
    with RecordingReader(tmp_path / "r.mcap") as reader:
        topics = [each.topic for each in reader.records(topics={"/lockstep/feedback", "/lockstep/degraded"})]
    assert topics == ["/lockstep/feedback"] * 10 + ["/lockstep/degraded", "/lockstep/feedback"]


def test_a_full_disk_ends_the_recording_with_its_reason_and_leaves_a_file_that_opens(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = Made(tmp_path)
    real, syncs = os.fdatasync, []

    def fill(handle: int) -> None:
        syncs.append(handle)
        if len(syncs) > 3:
            raise OSError(errno.ENOSPC, "No space left on device")
        real(handle)

    monkeypatch.setattr(os, "fdatasync", fill)
    made.robot()
    made.thread.start()
    for event in range(1, 200):
        made.feedback(event)
        made.picture(event, 50_000)
    assert made.ended.wait(PATIENCE)
    made.thread.close()
    assert made.thread.failure == "No space left on device"
    assert not made.thread.running
    with RecordingReader(tmp_path / "r.mcap") as reader:
        assert 1 <= reader.index.last_event < 199


def test_recording_ends_before_the_disk_is_full(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = Made(tmp_path, free_bytes=1_000_000)
    begun = threading.Event()
    real = shutil.disk_usage

    def filling(path: Path) -> Any:
        found = real(path)._replace(free=0 if begun.is_set() else 10**9)
        begun.set()
        return found

    monkeypatch.setattr(shutil, "disk_usage", filling)
    made.robot()
    made.feedback(1)
    made.pass_second()
    made.thread.start()
    assert made.ended.wait(PATIENCE)
    made.thread.close()
    assert "free on the disk" in made.thread.failure
    with RecordingReader(tmp_path / "r.mcap") as reader:
        assert not reader.interrupted


def test_on_a_disk_that_is_nearly_full_no_file_is_begun(tmp_path: Path) -> None:
    made = Made(tmp_path, free_bytes=10**18)
    made.robot()
    made.thread.start()
    assert made.ended.wait(PATIENCE)
    made.thread.close()
    assert "free on the disk" in made.thread.failure
    assert list(tmp_path.iterdir()) == []


def test_a_file_of_which_the_disk_takes_nothing_is_not_left_behind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(descriptor: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fdatasync", full)
    made = Made(tmp_path)
    made.robot()
    made.thread.start()
    assert made.ended.wait(PATIENCE)
    made.thread.close()
    assert made.thread.failure == "No space left on device"
    assert list(tmp_path.iterdir()) == []


def test_what_was_put_is_on_the_disk_within_a_second_without_anything_following(tmp_path: Path) -> None:
    made = Made(tmp_path)
    made.robot()
    made.feedback(1)
    made.pass_second()
    made.thread.start()
    deadline = threading.Event()
    for _ in range(200):
        index = made.thread.parts.index()
        if index is not None and index.chunks:
            break
        deadline.wait(0.05)
    index = made.thread.parts.index()
    assert index is not None
    with RecordingReader(tmp_path / "r.mcap", index) as reader:
        assert reader.index.last_event == 1
        assert list(reader.records(1, 1, {"/lockstep/feedback"}))
    made.thread.close()
