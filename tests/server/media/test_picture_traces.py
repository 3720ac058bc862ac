"""What is kept of the pictures sent to one peer, and the whole way with a real peer."""

import msgspec

from lockstep.protocol.carriers import EVENT_REFERENCE_URI
from lockstep.protocol.traces.trace import PictureSpans, known_spans
from lockstep.server.media.picture_traces import NEWEST, PictureTraces, SentPictures
from lockstep.server.media.pipeline.frame import EncodedFrame
from lockstep.server.media.pipeline.picture_span_times import PictureSpanTimes
from tests.server.media.feeding import stream
from tests.server.media.viewer import noise, running_plane, viewing

TIMING = PictureSpanTimes(
    PictureSpans(capture_ms=5.0, draw_ms=9.0), arrived=1.0, began=1.002, encoded=1.005, packetised=1.006
)


def _frame(stamp: int, timing: PictureSpanTimes | None = TIMING) -> EncodedFrame:
    return EncodedFrame(
        b"",
        lambda data, trailer: [],
        keyframe=True,
        marker=True,
        stamp=stamp,
        capture_time=0.0,
        media_time=0,
        timing=timing,
    )


def test_a_pictures_spans_are_those_of_its_source_and_of_the_console() -> None:
    assert known_spans(TIMING.spans(1.0065)) == {
        "capture_ms": 5.0,
        "encoder_wait_ms": 2.0,
        "encode_ms": 3.0,
        "packetise_ms": 1.0,
        "send_ms": 0.5,
    }


def test_a_source_that_measures_nothing_leaves_its_spans_out() -> None:
    assert "capture_ms" not in known_spans(TIMING._replace(source=msgspec.UNSET).spans())


def test_only_the_newest_pictures_are_kept_until_they_are_taken_once() -> None:
    sent = SentPictures("front")
    traces = PictureTraces([sent])
    traces.want(True)
    for number in range(1, 3 * NEWEST):
        sent.sent(_frame(number), number, 1.01)
    assert [each.stamp for each in traces.take(4)] == list(range(3 * NEWEST - 4, 3 * NEWEST))
    assert traces.take(4) == []


def test_nothing_of_before_is_told_to_a_peer_that_asks_again() -> None:
    sent = SentPictures("front")
    traces = PictureTraces([sent])
    traces.want(True)
    sent.sent(_frame(1), 1, 1.01)
    traces.want(False)
    traces.want(True)
    assert traces.take(4) == []


def test_a_picture_without_times_is_left_out() -> None:
    sent = SentPictures("front")
    sent.sent(_frame(1, None), 1, 1.01)
    assert sent.take(4) == []


async def test_a_peer_that_asks_is_told_the_rtp_timestamps_that_its_packets_have() -> None:
    async with (
        running_plane() as hub,
        viewing(hub, ["video"], codecs=["H264"], uris={EVENT_REFERENCE_URI: 9}) as viewer,
    ):
        viewer.media.traces.want(True)
        await stream(hub, viewer, "video", noise, 4)
        traces = viewer.media.traces.take(8)
        received = {item.packet.timestamp for item in viewer.of("video")}
        assert {each.rtp_time for each in traces} <= received
        assert [each.stamp for each in traces] == sorted(each.stamp for each in traces)
        assert {"encoder_wait_ms", "encode_ms", "packetise_ms", "send_ms"} <= known_spans(traces[-1].spans).keys()


async def test_nothing_is_kept_for_a_peer_that_does_not_ask() -> None:
    async with (
        running_plane() as hub,
        viewing(hub, ["video"], codecs=["H264"], uris={EVENT_REFERENCE_URI: 9}) as viewer,
    ):
        await stream(hub, viewer, "video", noise, 4)
        assert viewer.media.traces.take(8) == []
