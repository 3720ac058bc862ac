"""One encoding of each stream for all who take it, each of them from a keyframe on."""

from collections.abc import Mapping

from lockstep.server.media.frame_takers import FrameTakers
from lockstep.server.media.pipeline.frame import EncodedFrame
from lockstep.server.media.pipeline.recorded_encoding import FrameTaker


class Hub:
    def __init__(self) -> None:
        self.take: FrameTaker | None = None
        self.begun = 0
        self.keyframes = 0
        self.afresh: bool | None = None

    def record(self, take: FrameTaker | None, keyframe_seconds: float = 4.0) -> None:
        self.take = take
        self.begun += take is not None

    def record_keyframes(self, *, afresh: bool = True) -> None:
        self.keyframes += 1
        self.afresh = afresh

    def recorded_codecs(self) -> Mapping[str, str]:
        return {"front": "H264"}

    def give(self, stamp: int, *, keyframe: bool = False) -> None:
        assert self.take is not None
        frame = EncodedFrame(
            b"", lambda _, __: [], keyframe=keyframe, marker=True, stamp=stamp, capture_time=0.0, media_time=0
        )
        self.take("front", "H264", frame, attached=False)


class Taken(list[int]):
    """Stamps of the frames that one got."""

    def __call__(self, stream: str, codec: str, frame: EncodedFrame, *, attached: bool) -> None:
        self.append(frame.stamp)


def test_a_second_taker_leaves_the_first_ones_stream_alone_and_begins_with_a_keyframe() -> None:
    hub = Hub()
    takers = FrameTakers(hub)
    recorder, viewer = takers.add(), takers.add()
    first, second = Taken(), Taken()
    recorder.record(first, 4.0)
    hub.give(1, keyframe=True)
    viewer.record(second, 4.0)
    hub.give(2)
    hub.give(3, keyframe=True)
    hub.give(4)
    assert (first, second) == ([1, 2, 3, 4], [3, 4])
    assert (hub.begun, hub.keyframes, hub.afresh) == (1, 1, False)
    viewer.request_keyframes()
    assert (hub.keyframes, hub.afresh) == (2, False)
    recorder.record_keyframes()  # of a new file
    assert (hub.keyframes, hub.afresh) == (3, True)


def test_streams_are_taken_until_the_last_taker_has_ended() -> None:
    hub = Hub()
    takers = FrameTakers(hub)
    recorder, viewer = takers.add(), takers.add()
    first, second = Taken(), Taken()
    recorder.record(first, 4.0)
    viewer.record(second, 4.0)
    hub.give(1, keyframe=True)
    viewer.record(None, 4.0)
    viewer.record(None, 4.0)
    hub.give(2)
    assert (first, second) == ([1, 2], [1])
    recorder.record(None, 4.0)
    assert hub.take is None
    viewer.record(second, 4.0)
    hub.give(3)
    assert second == [1]  # what it showed before has no place in front of this one
    hub.give(4, keyframe=True)
    assert second == [1, 4]
