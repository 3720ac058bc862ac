"""What finds a place in the queue of a recording, and what is said of the rest."""

from typing import Any

import msgspec
import pytest

from lockstep.protocol.messages import Feedback
from lockstep.server.recording.format.records import EpisodeRecord
from lockstep.server.recording.writing import recording_queue
from lockstep.server.recording.writing.queue_items import FeedbackItem, Item, MediaItem, OwnItem
from lockstep.server.recording.writing.recording_queue import Lost, RecordingQueue
from tests.server.recording.makers import EPOCH, START


def feedback(event: int) -> Item:
    return FeedbackItem(START, START, EPOCH, Feedback(event=event, issue=1, time=float(event), axes=[0.0, 0.0]))


def picture(event: int, size: int) -> Item:
    return MediaItem(START, START, EPOCH, "front", "H264", event, True, bytes(size))


def said(taken: Any) -> list[int | str]:
    """Events, and numbers of lost items as text."""
    return [f"{each.items} lost" if isinstance(each, Lost) else each.feedback.event for each in taken]


def test_a_full_queue_leaves_out_the_newest_and_says_so_where_they_are_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recording_queue, "MAX_WAITING", 3)
    queue = RecordingQueue()
    for event in range(1, 6):
        queue.put(feedback(event))
    assert queue.take_lost() == 0, "the others come first"
    assert said(queue.take()) == [1, 2, 3]
    queue.put(feedback(6))
    assert said(queue.take()) == ["2 lost", 6]
    assert (queue.lost, queue.take_lost(), said(queue.take())) == (2, 0, [])


def test_what_was_left_out_behind_all_others_is_told_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recording_queue, "MAX_WAITING", 3)
    queue = RecordingQueue()
    for event in range(1, 6):
        queue.put(feedback(event))
    assert said(queue.take()) == [1, 2, 3]
    assert (queue.take_lost(), queue.take_lost()) == (2, 0)
    queue.put(feedback(6))
    assert said(queue.take()) == [6]


def test_large_pictures_fill_the_queue_before_their_number_does(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recording_queue, "MAX_BYTES", 1_000_000)
    queue = RecordingQueue()
    for event in range(1, 21):
        queue.put(picture(event, 100_000))
    assert queue.lost == 11
    assert 0.9 < queue.waiting <= 1.0
    assert len(list(queue.take())) == 9
    assert queue.waiting == 0.0


def test_a_full_queue_loses_marks_and_neither_begin_nor_end_of_an_episode(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recording_queue, "MAX_WAITING", 10)
    queue = RecordingQueue()
    for event in range(1, 31):
        queue.put(feedback(event))
    begun = EpisodeRecord(
        epoch=EPOCH, event=30, episode="a", number=1, kind="start", task="push", first_event=30, last_event=30
    )
    queue.put(OwnItem(START, begun))
    for number in range(1000):
        queue.put(OwnItem(START, msgspec.structs.replace(begun, kind="mark", text=f"{number}")))
    queue.put(OwnItem(START, msgspec.structs.replace(begun, kind="kept", event=31, last_event=31)))
    assert queue.lost == 20 + 1000
    found = [each.record for each in queue.take() if isinstance(each, OwnItem)]
    assert [each.kind for each in found if isinstance(each, EpisodeRecord)] == ["start", "kept"]
