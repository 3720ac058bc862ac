from lockstep.server.media.codecs.packetise import packetise_sound
from lockstep.server.media.encoding.frame_queue import FrameQueue
from lockstep.server.media.pipeline.frame import EncodedFrame


def frame(number: int, *, keyframe: bool = False) -> EncodedFrame:
    return EncodedFrame(
        b"%d" % number,
        packetise_sound,
        keyframe=keyframe,
        marker=True,
        stamp=number,
        capture_time=0.0,
        media_time=number,
    )


def drain(queue: FrameQueue) -> list[int]:
    numbers = []
    while (waiting := queue.peek()) is not None:
        numbers.append(waiting.stamp)
        queue.pop()
    return numbers


def test_nothing_leaves_before_the_first_keyframe() -> None:
    queue = FrameQueue(3, video=True)
    assert queue.put(frame(1))
    assert drain(queue) == []
    queue.put(frame(2, keyframe=True))
    queue.put(frame(3))
    assert drain(queue) == [2, 3]
    assert queue.dropped == 0


def test_a_full_video_outbox_is_emptied_and_asks_for_a_keyframe_once() -> None:
    queue = FrameQueue(3, video=True)
    complete = [queue.put(frame(i, keyframe=i == 1)) for i in range(1, 7)]
    assert complete == [True, True, True, False, True, True]
    assert drain(queue) == []
    assert queue.dropped == 4
    queue.put(frame(9, keyframe=True))
    assert drain(queue) == [9]


def test_a_keyframe_replaces_what_is_older() -> None:
    queue = FrameQueue(3, video=True)
    for i in range(1, 4):
        queue.put(frame(i, keyframe=i == 1))
    queue.put(frame(4, keyframe=True))
    assert drain(queue) == [4]
    assert queue.dropped == 3


def test_a_full_sound_outbox_keeps_the_newest() -> None:
    queue = FrameQueue(3, video=False)
    assert all(queue.put(frame(i, keyframe=True)) for i in range(1, 6))
    assert drain(queue) == [3, 4, 5]
    assert queue.dropped == 2
