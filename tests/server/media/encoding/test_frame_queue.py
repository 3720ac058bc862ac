from lockstep.server.media.codecs.packetise import packetise_sound
from lockstep.server.media.encoding.frame_queue import Outbox
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


def drain(outbox: Outbox) -> list[int]:
    numbers = []
    while (waiting := outbox.peek()) is not None:
        numbers.append(waiting.stamp)
        outbox.pop()
    return numbers


def test_nothing_leaves_before_the_first_keyframe() -> None:
    outbox = Outbox(3, video=True)
    assert outbox.put(frame(1))
    assert drain(outbox) == []
    outbox.put(frame(2, keyframe=True))
    outbox.put(frame(3))
    assert drain(outbox) == [2, 3]
    assert outbox.dropped == 0


def test_a_full_video_outbox_is_emptied_and_asks_for_a_keyframe_once() -> None:
    outbox = Outbox(3, video=True)
    complete = [outbox.put(frame(i, keyframe=i == 1)) for i in range(1, 7)]
    assert complete == [True, True, True, False, True, True]
    assert drain(outbox) == []
    assert outbox.dropped == 4
    outbox.put(frame(9, keyframe=True))
    assert drain(outbox) == [9]


def test_a_keyframe_replaces_what_is_older() -> None:
    outbox = Outbox(3, video=True)
    for i in range(1, 4):
        outbox.put(frame(i, keyframe=i == 1))
    outbox.put(frame(4, keyframe=True))
    assert drain(outbox) == [4]
    assert outbox.dropped == 3


def test_a_full_sound_outbox_keeps_the_newest() -> None:
    outbox = Outbox(3, video=False)
    assert all(outbox.put(frame(i, keyframe=True)) for i in range(1, 6))
    assert drain(outbox) == [3, 4, 5]
    assert outbox.dropped == 2
