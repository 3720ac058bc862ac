"""Spans: durations on one clock each, and the remainder between clocks."""

import math

import msgspec
import pytest

from lockstep.protocol.errors import MessageError
from lockstep.protocol.messages import (
    Feedback,
    Media,
    RobotFeedback,
    decode_message,
    encode_message,
    plain_feedback,
    spans_of,
)
from lockstep.protocol.traces.trace import (
    COMMAND_WAY,
    MAX_SPAN_MS,
    PICTURE_WAY,
    CommandSpans,
    PictureSpans,
    join_spans,
    known_spans,
    remainder_ms,
    span_ms,
    spans_at_bridge,
    sum_of_spans,
)
from tests.makers import feedback


def test_the_ways_name_every_span_once() -> None:
    assert sorted(span.name for span in PICTURE_WAY) == sorted(PictureSpans.__struct_fields__)
    assert sorted(span.name for span in COMMAND_WAY) == sorted(CommandSpans.__struct_fields__)


@pytest.mark.parametrize(
    ("seconds", "ms"),
    [(0.0123456, 12.346), (-1.0, 0.0), (math.nan, 0.0), (math.inf, 0.0), (1e9, MAX_SPAN_MS)],
)
def test_a_duration_becomes_a_span_that_every_reader_accepts(seconds: float, ms: float) -> None:
    assert span_ms(seconds) == ms
    assert msgspec.convert({"encode_ms": span_ms(seconds)}, PictureSpans).encode_ms == ms


def test_spans_that_nobody_has_measured_are_not_on_the_wire() -> None:
    assert msgspec.json.encode(PictureSpans(encode_ms=1.5)) == b'{"encode_ms":1.5}'
    assert known_spans(msgspec.json.decode(b"{}", type=PictureSpans)) == {}


def test_joined_spans_are_those_of_both() -> None:
    joined = join_spans(PictureSpans(capture_ms=1.0, encode_ms=2.0), PictureSpans(encode_ms=3.0))
    assert known_spans(joined) == {"capture_ms": 1.0, "encode_ms": 3.0}
    assert sum_of_spans(joined) == 4.0
    assert sum_of_spans(joined, ["encode_ms", "draw_ms"]) == 3.0


def test_a_bridge_speaks_of_its_own_spans_alone() -> None:
    sent = PictureSpans(capture_ms=1.0, encode_ms=2.0, draw_ms=3.0, between_ms=4.0)
    assert known_spans(spans_at_bridge(sent)) == {"capture_ms": 1.0}
    assert known_spans(spans_at_bridge(CommandSpans(apply_ms=1.0, link_ms=2.0))) == {"apply_ms": 1.0}


def test_the_remainder_is_what_the_parts_leave_of_the_whole_and_never_negative() -> None:
    assert remainder_ms(10.0, 2.0, 3.0) == 5.0
    assert remainder_ms(10.0, 11.0) == 0.0


def test_a_feedback_with_spans_keeps_them_on_the_link_and_loses_them_on_the_way_on() -> None:
    spans = CommandSpans(tick_wait_ms=1.0)
    sent = RobotFeedback(**msgspec.structs.asdict(feedback(3)), spans=spans)
    read = decode_message(encode_message(sent))
    assert read == sent
    assert isinstance(read, Feedback)
    assert spans_of(read) == spans
    assert plain_feedback(read) == feedback(3)
    assert b"spans" not in msgspec.json.encode(plain_feedback(read))


def test_a_feedback_without_spans_is_a_plain_one() -> None:
    assert decode_message(encode_message(feedback(3))) == feedback(3)
    assert spans_of(feedback(3)) == CommandSpans()


@pytest.mark.parametrize("value", [-1.0, math.nan, 1e7, "1", None])
def test_a_span_out_of_range_makes_its_message_malformed(value: object) -> None:
    fields = {"type": "media", "stream": "c", "codec": "mjpeg", "stamp": 1, "time": 0.0, "payload": b""}
    good = {**fields, "spans": {"capture_ms": 1.0, "unheard_of": 2}}
    assert isinstance(decode_message(msgspec.msgpack.encode(good)), Media)
    with pytest.raises(MessageError):
        decode_message(msgspec.msgpack.encode({**fields, "spans": {"capture_ms": value}}))
