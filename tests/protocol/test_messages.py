import contextlib

import msgspec
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from lockstep.protocol.errors import MessageError
from lockstep.protocol.messages import Command, Feedback, LinkMessage, Ping, decode_message, encode_message
from lockstep.protocol.serial import MAX_EVENT
from tests.protocol.strategies import as_map, link_messages, mutated


def pack(value: object) -> bytes:
    return msgspec.msgpack.encode(value)


def command(**changes: object) -> dict[str, object]:
    return {"type": "command", "event": 2, "issue": 1, "values": [0.5], **changes}


@given(link_messages)
def test_every_message_survives_the_wire(message: LinkMessage) -> None:
    assert decode_message(encode_message(message)) == message


@given(link_messages)
def test_unknown_fields_are_ignored(message: LinkMessage) -> None:
    assert decode_message(pack({**as_map(message), "from_the_future": [1, {"a": None}]})) == message


def test_a_message_is_a_map_whose_type_names_its_kind() -> None:
    assert as_map(Ping(id=7)) == {"type": "ping", "id": 7}


def test_whole_numbers_are_taken_for_floats() -> None:
    decoded = decode_message(pack(command(values=[1, -2, 2**63])))
    assert isinstance(decoded, Command)
    assert decoded.values == [1.0, -2.0, float(2**63)]


@pytest.mark.parametrize(
    "value",
    [
        command(event=0),
        command(event=-1),
        command(event=MAX_EVENT + 1),
        command(event=2.5),
        command(event="2"),
        command(event=None),
        command(issue=0),
        command(issue=2**53),
        {"type": "ping", "id": 2**63},
        {"type": "refusal", "event": -1, "reason": "late", "current": 1},
        command(values=[0.0] * 257),
        command(values=["fast"]),
        command(speed=1.1),
        command(speed=-0.1),
        command(values=[True]),
        command(values=0.5),
        command(type="teleport"),
        {"event": 2, "issue": 1, "values": []},
        {"type": "command", "event": 2, "issue": 1},
        {"type": "hello", "role": "admin"},
        {"type": "hello", "role": "operator", "name": "x" * 501},
        {"type": "media", "stream": "a", "codec": "av1", "stamp": 1, "time": 0.0, "payload": b""},
        {"type": "media", "stream": "a", "codec": "mjpeg", "stamp": 0, "time": 0.0, "payload": b""},
        {"type": "media", "stream": "a", "codec": "mjpeg", "stamp": 1, "time": 0.0, "payload": b"", "width": 8193},
        {"type": 5},
        [],
        "command",
        None,
        3,
    ],
)
def test_a_message_of_the_wrong_kind_type_or_range_is_refused(value: object) -> None:
    with pytest.raises(MessageError):
        decode_message(pack(value))


@pytest.mark.parametrize("data", [b"", b"\xc1", b"\x81", b"\xff\xff", b"\x91" * 100_000, b"\x81\xa1" * 5000])
def test_what_is_not_messagepack_is_refused(data: bytes) -> None:
    with pytest.raises(MessageError):
        decode_message(data)


def test_bytes_behind_a_message_are_refused() -> None:
    with pytest.raises(MessageError):
        decode_message(encode_message(Ping(id=1)) + b"\x00")


@given(st.binary(max_size=300) | mutated(link_messages.map(encode_message)))
@example(b"\xdf\xff\xff\xff\xff")
@example(b"\xdd\xff\xff\xff\xff")
@example(b"\x81\xa4type\xa7command")
def test_any_bytes_give_a_message_or_a_message_error(data: bytes) -> None:
    with contextlib.suppress(MessageError):
        decode_message(data)


def test_the_defaults_of_a_feedback_say_at_rest_and_not_stopped() -> None:
    feedback = Feedback(event=1, issue=1, time=0.0, axes=[])
    assert feedback.at_rest
    assert not feedback.stop.stopped
