import contextlib
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.protocol.console import Rename, Report, SeatRelease, SeatRequest, encode_console_message
from lockstep.protocol.messages import Command, Ping, Reset, Rest, Stop
from lockstep.server.errors import (
    BinaryMessage,
    ChannelError,
    Flood,
    MalformedMessage,
    MessageTooLarge,
    UnknownChannel,
    WrongChannel,
)
from lockstep.server.peers.channels import (
    CHANNELS,
    MAX_MESSAGE,
    ChannelName,
    MessageBudget,
    channel_name,
    parse_message,
    stop_in,
)

MESSAGES = [
    Command(event=2, issue=1, values=[0.5]),
    Rest(event=2),
    Report(event=1),
    Ping(id=3),
    SeatRequest(),
    SeatRelease(),
    Rename(name="Ada"),
    Stop(by="", reason="dog"),
    Reset(by=""),
]
names = st.sampled_from(list(CHANNELS))
json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
)


@pytest.mark.parametrize("message", MESSAGES)
@pytest.mark.parametrize("channel", list(CHANNELS))
def test_a_message_passes_where_it_belongs_and_nowhere_else(channel: ChannelName, message: Command) -> None:
    text = encode_console_message(message)
    if isinstance(message, CHANNELS[channel]):
        assert parse_message(channel, text) == message
    else:
        with pytest.raises(WrongChannel):
            parse_message(channel, text)


@pytest.mark.parametrize("channel", list(CHANNELS))
def test_a_stop_is_taken_from_every_channel(channel: ChannelName) -> None:
    assert parse_message(channel, encode_console_message(Stop())) == Stop()


def test_the_labels_are_the_channels() -> None:
    assert [channel_name(label) for label in ("control", "session", "stop")] == ["control", "session", "stop"]
    for label in ("", "Control", "control ", "x" * 70000):
        with pytest.raises(UnknownChannel):
            channel_name(label)


@pytest.mark.parametrize(
    ("data", "error"),
    [
        (b"{}", BinaryMessage),
        (None, BinaryMessage),
        ("x" * (MAX_MESSAGE + 1), MessageTooLarge),
        ("", MalformedMessage),
        ("{", MalformedMessage),
        ("[]", MalformedMessage),
        ("{}", MalformedMessage),
        ('{"type":"launch"}', MalformedMessage),
        ('{"type":"command","event":0,"issue":1,"values":[]}', MalformedMessage),
        ('{"type":"command","event":2147483648,"issue":1,"values":[]}', MalformedMessage),
        ('{"type":"command","event":1,"issue":1,"values":[NaN]}', MalformedMessage),
        ('{"type":"command","event":1,"issue":1,"values":[1e999]}', MalformedMessage),
        ('{"type":"command","event":1,"issue":1,"values":"fast"}', MalformedMessage),
        (json.dumps({"type": "command", "event": 1, "issue": 1, "values": [0] * 257}), MalformedMessage),
        ('{"type":"ping","id":1}' + "\ud800", MalformedMessage),
        ("[" * 10000, MalformedMessage),
        ('{"type":"ping","x":' + "[" * 10000, MalformedMessage),
    ],
)
def test_what_is_no_message_gets_its_name(data: object, error: type[ChannelError]) -> None:
    with pytest.raises(error):
        parse_message("control", data)


@given(names, st.text() | st.binary())
def test_no_text_and_no_bytes_raise_anything_else(channel: ChannelName, data: str | bytes) -> None:
    with pytest.raises(ChannelError):
        parse_message(channel, data)


@given(names, st.sampled_from(MESSAGES), st.dictionaries(st.text(), json_values), st.sampled_from(["add", "replace"]))
def test_no_field_of_a_real_message_raises_anything_else(
    channel: ChannelName, message: Command, fields: dict[str, object], how: str
) -> None:
    real = json.loads(encode_console_message(message))
    mutated = {**fields, **real} if how == "add" else {**real, **dict.fromkeys(real, fields)}
    with contextlib.suppress(ChannelError):
        parse_message(channel, json.dumps(mutated))


@given(names, st.sampled_from(MESSAGES), st.integers(0, 200), st.text(max_size=3))
def test_no_change_in_the_text_raises_anything_else(
    channel: ChannelName, message: Command, place: int, text: str
) -> None:
    real = encode_console_message(message)
    with contextlib.suppress(ChannelError):
        parse_message(channel, real[:place] + text + real[place + 1 :])


def test_a_burst_is_allowed_and_a_flood_is_not() -> None:
    budget = MessageBudget(10)
    for _ in range(10):
        budget.spend(0.0)
    with pytest.raises(Flood):
        budget.spend(0.05)
    budget.spend(0.2)


def test_silence_saves_up_no_more_than_one_burst() -> None:
    budget = MessageBudget(10)
    for _ in range(10):
        budget.spend(1000.0)
    with pytest.raises(Flood):
        budget.spend(1000.0)


@pytest.mark.parametrize(
    ("data", "reason", "press"),
    [
        ('{"type": "stop", "press": "%s"}' % ("x" * 65), "", "x" * 65),
        ('{"type": "stop", "press": 17, "reason": null}', "null", "17"),
        ('{"type": "stop", "by": [], "reason": "dog"}', "dog", ""),
        ('{"type": "stop", "reason": "%s"}' % ("x" * 501), "x" * 500, ""),
        (b'{"type": "stop", "reason": "dog"}', "dog", ""),
        (r'{"type": "stop", "reason": "dog \ud83d", "press": "\ude00"}', "dog ?", "?"),
        (r'{"type": "stop", "reason": ["\ud83d"]}', r'["\ud83d"]', ""),
    ],
)
def test_what_says_that_it_is_a_stop_is_one_whatever_else_is_wrong_with_it(
    data: str | bytes, reason: str, press: str
) -> None:
    with pytest.raises(ChannelError):
        parse_message("stop", data)
    assert stop_in(data) == Stop(reason=reason, press=press)


@given(st.text() | st.binary() | st.none())
def test_what_does_not_say_so_is_none(data: object) -> None:
    assert stop_in(data) is None


@pytest.mark.parametrize(
    "data",
    [
        r'{"type": "reset", "by": "\ud83d"}',
        r'["\ud83d"]',
        '{"type": "reset"}',
        "{}",
        b"{}",
        '{"reason": "no type"}',
        r'{"reason": "\ud83d"}',
        '{"type": "stop"',
        '"stop"',
        "[" * 9000,
        "x" * 99_999,
        5,
    ],
)
def test_nothing_else_becomes_a_stop(data: object) -> None:
    assert stop_in(data) is None
