"""Which encoding of a stream each peer gets."""

from lockstep.server.media.codecs.packetise import packetise_h264
from lockstep.server.media.pipeline.frame import EncodedFrame
from tests.server.media.pipeline.collecting import Counted


def frame(keyframe: bool) -> EncodedFrame:
    return EncodedFrame(b"x", packetise_h264, keyframe=keyframe, marker=True, stamp=1, capture_time=0.0, media_time=0)


def test_a_peer_that_moves_gets_its_old_tier_until_the_new_one_has_a_keyframe() -> None:
    counted = Counted()
    encodings, target = counted.encodings("H264", "VP8"), counted.subscription()
    encodings.join("H264", target, "high")
    encodings.move("H264", target, "low")
    high, low = encodings.own.get("H264", "high"), encodings.own.get("H264", "low")
    low.publishing(frame(keyframe=False))
    assert (list(high.targets), list(low.targets), high.needed, low.needed) == ([target], [], True, True)
    low.publishing(frame(keyframe=True))
    assert (list(high.targets), list(low.targets), high.needed) == ([], [target], False)


def test_a_move_that_is_taken_back_in_time_changes_nothing() -> None:
    counted = Counted()
    encodings, target = counted.encodings("H264"), counted.subscription()
    encodings.join("H264", target, "high")
    encodings.move("H264", target, "low")
    encodings.move("H264", target, "high")
    low = encodings.own.get("H264", "low")
    low.publishing(frame(keyframe=True))
    assert (low.needed, list(encodings.own.get("H264", "high").targets)) == (False, [target])


def test_sound_moves_only_when_all_of_its_codec_have_got_the_same() -> None:
    counted = Counted()
    encodings, target = counted.encodings("opus", "PCMU", video=False), counted.subscription()
    encodings.join("opus", target)
    encodings.move("opus", target, "crowd")
    crowd = encodings.own.get("opus", "crowd")
    crowd.publishing(frame(keyframe=True))
    encodings.own.move_all("PCMU")
    assert list(crowd.targets) == []
    encodings.own.move_all("opus")
    assert list(crowd.targets) == [target]


def test_who_has_left_is_moved_nowhere_and_the_stream_is_taken_by_nobody() -> None:
    counted = Counted()
    encodings, target = counted.encodings("H264"), counted.subscription()
    encodings.join("H264", target)
    taken = [encodings.is_taken]
    encodings.leave(target)
    encodings.leave(target)
    encodings.move("H264", target, "low")
    assert [*taken, encodings.is_taken] == [True, False]
    assert not any(each.needed for each in encodings)
    assert counted.registry.get_sample_value("lockstep_media_peers", {"stream": "camera0"}) == 0


def test_a_peer_of_the_cameras_own_encoding_that_lost_a_picture_returns_to_the_tier_that_it_was_given() -> None:
    counted = Counted()
    encodings, target = counted.encodings("H264"), counted.subscription()
    passed = encodings.add_passed()
    encodings.join("H264", target, "high")
    encodings.own.get("H264", "high").leave(target)
    passed.targets[target] = None
    encodings.move("H264", target, "low")
    encodings.request_keyframe(target, "pli")
    assert list(passed.targets) == [target]
    encodings.own.get("H264", "low").publishing(frame(keyframe=True))
    assert (list(passed.targets), list(encodings.own.get("H264", "low").targets)) == ([], [target])
