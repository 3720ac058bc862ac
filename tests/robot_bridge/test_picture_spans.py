"""The spans of a picture at the bridge."""

import msgspec

from lockstep.protocol.messages import Media, decode_message
from lockstep.protocol.traces.trace import PictureSpans
from lockstep.robot_bridge.link.sending.link_publisher import encode_waited
from lockstep.robot_bridge.media_sources import with_spans

PICTURE = Media(stream="front", codec="mjpeg", stamp=3, time=10.0, payload=b"")


def test_a_picture_is_captured_from_the_moment_that_it_shows_until_it_is_whole() -> None:
    assert with_spans(PICTURE, 9.98, 10.005).spans == PictureSpans(camera_wait_ms=20.0, capture_ms=5.0)


def test_an_event_that_is_forgotten_leaves_its_span_out() -> None:
    assert with_spans(PICTURE, None, 10.005).spans == PictureSpans(capture_ms=5.0)


def test_what_its_source_has_measured_itself_stays_and_encoding_is_no_part_of_the_capture() -> None:
    encoded = msgspec.structs.replace(PICTURE, spans=PictureSpans(bridge_encode_ms=2.0))
    assert with_spans(encoded, None, 10.005).spans == PictureSpans(capture_ms=3.0, bridge_encode_ms=2.0)
    measured = msgspec.structs.replace(PICTURE, spans=PictureSpans(capture_ms=1.0, camera_wait_ms=7.0))
    assert with_spans(measured, 9.98, 10.005).spans == PictureSpans(capture_ms=1.0, camera_wait_ms=7.0)


def test_a_picture_waits_until_the_first_link_takes_it() -> None:
    now = 10.0
    make = encode_waited(with_spans(PICTURE, None, 10.0), lambda: now)
    now = 10.004
    first = make()
    now = 10.5
    assert make() is first
    media = decode_message(first[4:])
    assert isinstance(media, Media)
    assert media.spans == PictureSpans(capture_ms=0.0, link_wait_ms=4.0)
