import contextlib
import json

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.protocol import console
from lockstep.protocol.console import (
    ClientMessage,
    Report,
    SeatRelease,
    SeatRequest,
    StreamReport,
    Welcome,
    decode_client_message,
    decode_server_message,
    encode_console_message,
)
from lockstep.protocol.errors import MessageError
from lockstep.protocol.messages import Command, Feedback, Ping, Rest, Stop
from tests.protocol.strategies import mutated

CLIENT_MESSAGES: list[ClientMessage] = [
    Command(event=2, issue=1, values=[0.5, -1.0]),
    Rest(event=7),
    Report(event=4, armed=True, streams=[StreamReport(stream="overview", carrier="native", stamp=4)]),
    Ping(id=1),
    SeatRequest(),
    SeatRelease(),
    console.Rename(name="Ada"),
    Stop(by="Ada", reason="person in the way"),
]


@pytest.mark.parametrize("message", CLIENT_MESSAGES, ids=lambda message: type(message).__name__)
def test_a_client_message_survives_the_wire(message: ClientMessage) -> None:
    assert decode_client_message(encode_console_message(message)) == message


def test_a_server_message_survives_the_wire() -> None:
    welcome = Welcome(peer="p1", role="operator", name="Ada", streams=[])
    assert decode_server_message(encode_console_message(welcome)) == welcome


def test_messages_are_json_text_with_a_type() -> None:
    assert json.loads(encode_console_message(SeatRequest())) == {"type": "seat_request", "only_if_free": False}


def test_a_client_cannot_speak_as_the_server() -> None:
    with pytest.raises(MessageError):
        decode_client_message(encode_console_message(Feedback(event=1, issue=1, time=0.0, axes=[])))


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        "null",
        '{"type": "command", "event": 0, "issue": 1, "values": []}',
        '{"type": "command", "event": 2147483648, "issue": 1, "values": []}',
        '{"type": "command", "event": 2, "issue": 1, "values": [NaN]}',
        '{"type": "command", "event": 2, "issue": 1, "values": [1e999]}',
        '{"type": "rename", "name": "' + "x" * 61 + '"}',
        '{"type": "report", "streams": ' + json.dumps([{"stream": "a", "carrier": "none"}] * 33) + "}",
        '{"type": "ping", "id": "\ud800"}',
        # A page reads numbers as long as these as infinite, and refuses the whole message that shares them with it.
        *(f'{{"type": "report", "{field}": 1{"0" * 400}}}' for field in ("event", "ping")),
        *(
            f'{{"type": "report", "streams": [{{"stream": "a", "carrier": "none", "{field}": 1{"0" * 400}}}]}}'
            for field in ("stamp", "gap", "max_gap", "lag", "tolerance", "rendered")
        ),
        '{"type": "report", "picture_delay_ms": 1e300}',
        '{"type": "report", "round_trip_ms": -1e300}',
        '{"type": "command", "event": 2, "issue": 9007199254740992, "values": [0]}',
        "[" * 100_000,
    ],
)
def test_a_malformed_client_message_is_refused(text: str) -> None:
    with pytest.raises(MessageError):
        decode_client_message(text)


def test_bytes_that_are_not_utf8_are_refused() -> None:
    with pytest.raises(MessageError):
        decode_client_message(b'{"type": "rename", "name": "\xff"}')
    with pytest.raises(MessageError):
        decode_server_message(b'{"type": "notice", "level": "info", "text": "\xff"}')


@given(
    st.binary(max_size=200)
    | mutated(st.sampled_from([encode_console_message(message).encode() for message in CLIENT_MESSAGES]))
)
def test_any_bytes_give_a_client_message_or_a_message_error(data: bytes) -> None:
    with contextlib.suppress(MessageError):
        decode_client_message(data)


def test_every_public_name_of_the_module_exists() -> None:
    assert all(hasattr(console, name) for name in console.__all__)


def test_reports_never_count_below_zero() -> None:
    with pytest.raises(MessageError):
        decode_client_message(msgspec.json.encode({"type": "report", "event": -1}))
