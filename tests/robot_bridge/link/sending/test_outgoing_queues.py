from lockstep.protocol.messages import Media, MediaCodec
from lockstep.robot_bridge.link.sending.outgoing_queues import ORDERED_DEPTH, MediaOutbox, NewestOutbox


def medium(stamp: int, stream: str = "camera", codec: MediaCodec = "yuv420p", keyframe: bool = True) -> Media:
    return Media(stream=stream, codec=codec, stamp=stamp, time=0.0, payload=b"", keyframe=keyframe)


def put(outbox: MediaOutbox[int], media: Media) -> None:
    outbox.put(media, lambda: media.stamp)


def drain(outbox: MediaOutbox[int]) -> list[int]:
    items = []
    while (item := outbox.pop()) is not None:
        items.append(item)
    return items


def test_of_one_key_only_the_newest_waits_and_the_others_are_counted() -> None:
    outbox: NewestOutbox[str, int] = NewestOutbox()
    for item in (1, 2, 3):
        outbox.put("feedback", item)
    outbox.put("refusal", 4)
    assert len(outbox) == 2
    assert [outbox.pop(), outbox.pop(), outbox.pop()] == [3, 4, None]
    assert outbox.drops == {"feedback": 2}


def test_a_newer_one_waits_behind_what_was_put_in_before_it() -> None:
    """Of STOP, RESET, STOP the last is what the other side hears last."""
    outbox: NewestOutbox[str, str] = NewestOutbox()
    for key, item in (("stop", "first"), ("reset", "reset"), ("stop", "second")):
        outbox.put(key, item)
    assert [outbox.pop(), outbox.pop(), outbox.pop()] == ["reset", "second", None]


def test_of_one_camera_only_the_newest_picture_waits() -> None:
    outbox: MediaOutbox[int] = MediaOutbox()
    for stamp in (1, 2, 3):
        put(outbox, medium(stamp))
    assert drain(outbox) == [3]
    assert outbox.drops == {"camera": 2}


def test_streams_do_not_replace_each_other_and_take_turns() -> None:
    outbox: MediaOutbox[int] = MediaOutbox()
    for stamp in range(3):
        put(outbox, medium(stamp, "microphone", "pcm_s16le"))
    put(outbox, medium(10))
    put(outbox, medium(20, "wrist"))
    assert len(outbox) == 5
    assert drain(outbox) == [0, 10, 20, 1, 2]


def test_sound_waits_in_order_and_loses_the_oldest() -> None:
    outbox: MediaOutbox[int] = MediaOutbox()
    for stamp in range(ORDERED_DEPTH + 2):
        put(outbox, medium(stamp, "microphone", "pcm_s16le"))
    assert drain(outbox) == list(range(2, ORDERED_DEPTH + 2))
    assert outbox.drops == {"microphone": 2}


def test_a_keyframe_replaces_what_waits_and_dependent_pictures_follow_it() -> None:
    outbox: MediaOutbox[int] = MediaOutbox()
    put(outbox, medium(1, codec="h264"))
    put(outbox, medium(2, codec="h264", keyframe=False))
    put(outbox, medium(3, codec="h264"))
    put(outbox, medium(4, codec="h264", keyframe=False))
    assert drain(outbox) == [3, 4]
    assert outbox.drops == {"camera": 2}


def test_when_dependent_pictures_do_not_fit_the_stream_resumes_with_a_keyframe() -> None:
    outbox: MediaOutbox[int] = MediaOutbox()
    put(outbox, medium(0, codec="h264"))
    for stamp in range(1, ORDERED_DEPTH + 3):
        put(outbox, medium(stamp, codec="h264", keyframe=False))
    assert drain(outbox) == []
    assert outbox.drops == {"camera": ORDERED_DEPTH + 3}
    put(outbox, medium(50, codec="h264"))
    put(outbox, medium(51, codec="h264", keyframe=False))
    assert drain(outbox) == [50, 51]
