from lockstep.server.media.sources.latest_value import MOST_DEPENDENT, MOST_SOUND, LatestValue
from lockstep.server.media.sources.source_wire import Captured, Trouble


def jpeg(time: float) -> Captured:
    return Captured("mjpeg", time, b"")


def h264(time: float, keyframe: bool = False) -> Captured:
    return Captured("h264", time, b"", keyframe=keyframe)


def test_of_pictures_that_stand_for_themselves_the_newest_is_kept() -> None:
    box = LatestValue()
    assert [box.put(jpeg(1)), box.put(jpeg(2))] == [True, False]
    assert box.take() == [jpeg(2)]
    assert box.dropped == 1
    assert box.take() == []
    assert box.put(jpeg(3))


def test_sound_keeps_its_newest_segments_in_order() -> None:
    box = LatestValue()
    segments = [Captured("pcm_s16le", i, b"") for i in range(MOST_SOUND + 2)]
    for segment in segments:
        box.put(segment)
    assert box.take() == segments[2:]


def test_pictures_that_build_on_a_dropped_one_go_until_the_next_keyframe() -> None:
    box = LatestValue()
    box.put(h264(0, keyframe=True))
    for i in range(1, MOST_DEPENDENT + 5):
        box.put(h264(i))
    assert box.take() == []
    assert not box.put(h264(90))
    assert box.put(h264(91, keyframe=True))
    assert not box.put(h264(92))
    assert box.take() == [h264(91, keyframe=True), h264(92)]
    assert box.dropped == MOST_DEPENDENT + 6


def test_words_come_first_and_are_bounded() -> None:
    box = LatestValue()
    box.put(jpeg(1))
    for i in range(20):
        box.put(Trouble("refused", str(i)))
    found = box.take()
    assert [said.detail for said in found if isinstance(said, Trouble)] == [str(i) for i in range(12, 20)]
    assert found[-1] == jpeg(1)
