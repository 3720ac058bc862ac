"""What a live viewer's queue keeps, drops and leaves out."""

from hypothesis import given
from hypothesis import strategies as st

from lockstep.protocol.messages import Feedback
from lockstep.server.recording.format.records import NoteRecord, RobotRecord
from lockstep.server.recording.writing.live_queue import ITEM_BYTES, LiveQueue, size_of
from lockstep.server.recording.writing.queue_items import FeedbackItem, Item, MediaItem, OwnItem, RobotItem
from tests.server.recording.makers import CODECS, DESCRIPTION, EPOCH, START

ROBOT = RobotItem(START, RobotRecord(epoch=EPOCH, event=1, link="up", description=DESCRIPTION), CODECS)
NOTE = OwnItem(START, NoteRecord(epoch=EPOCH, event=1, peer="p", name="Ada", role="operator", text="x"))


def picture(number: int, *, keyframe: bool = False, stream: str = "front", size: int = 0) -> MediaItem:
    return MediaItem(START + number, START, EPOCH, stream, "H264", 1, keyframe, bytes(size))


def taken(queue: LiveQueue) -> list[Item]:
    found = []
    while (each := queue.take()) is not None:
        found.append(each[0])
    return found


def test_large_pictures_fill_it_before_their_number_does() -> None:
    queue = LiveQueue(max_items=100, max_bytes=10 * (ITEM_BYTES + 1000))
    for number in range(50):
        queue.put(picture(number, keyframe=True, size=1000))
        assert queue.waiting_bytes <= 10 * (ITEM_BYTES + 1000)
    assert (len(queue), queue.dropped, queue.dropped_media, queue.dropped_robot) == (10, 40, True, False)
    assert taken(queue) == [picture(number, keyframe=True, size=1000) for number in range(40, 50)]
    assert queue.waiting_bytes == 0


def test_an_item_that_is_larger_than_the_bound_goes_alone() -> None:
    queue = LiveQueue(max_items=100, max_bytes=ITEM_BYTES)
    queue.put(ROBOT)
    queue.put(picture(1, keyframe=True, size=1000))
    assert queue.dropped_robot
    assert len(taken(queue)) == 1


def test_long_lists_of_a_feedback_count() -> None:
    feedback = Feedback(event=1, issue=1, time=1.0, axes=[], joints=[], ranges=[1.0] * 4000)
    assert size_of(FeedbackItem(START, START, EPOCH, feedback)) > 100_000


def test_after_a_dropped_picture_its_camera_goes_on_with_a_keyframe_and_the_other_is_whole() -> None:
    queue = LiveQueue(max_items=5)
    queue.put(picture(0, keyframe=True))
    queue.put(picture(1, keyframe=True, stream="side"))
    assert len(taken(queue)) == 2
    for number in (2, 3, 4):  # 2 is dropped
        queue.put(picture(number))
    queue.put(picture(5, stream="side"))
    queue.put(picture(6, keyframe=True))
    queue.put(picture(7))
    assert taken(queue) == [picture(5, stream="side"), picture(6, keyframe=True), picture(7)]
    assert queue.dropped == 3


@given(st.lists(st.sampled_from(["delta", "keyframe", "sound", "note", "take", "take all"]), max_size=80))
def test_no_picture_is_taken_that_builds_on_one_that_was_not(does: list[str]) -> None:
    queue, found, put = LiveQueue(max_items=4), list[Item](), list[MediaItem]()
    queue.put(picture(0, keyframe=True))
    put.append(picture(0, keyframe=True))
    for number, do in enumerate(does, 1):
        match do:
            case "take":
                found += [each[0]] if (each := queue.take()) is not None else []
            case "take all":
                found += taken(queue)
            case "note":
                queue.put(NOTE)
            case "sound":
                queue.put(MediaItem(START, START, EPOCH, "front", "opus", 1, True, b""))
            case _:
                put.append(picture(number, keyframe=do == "keyframe"))
                queue.put(put[-1])
    found += taken(queue)
    shown = {each.arrived for each in found if isinstance(each, MediaItem) and each.codec == "H264"}
    for before, after in zip(put, put[1:], strict=False):
        assert after.keyframe or after.arrived not in shown or before.arrived in shown
