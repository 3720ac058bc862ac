import struct

import pytest
from aioice import stun
from hypothesis import given
from hypothesis import strategies as st

from lockstep.emulator.impairment.packets import Kind, kind_of, stun_username


@pytest.mark.parametrize(
    ("first", "kind"),
    [
        (0, "stun"),
        (3, "stun"),
        (20, "control"),
        (63, "control"),
        (64, "control"),
        (128, "media"),
        (191, "media"),
        (192, "control"),
    ],
)
def test_the_first_byte_says_what_a_datagram_is(first: int, kind: Kind) -> None:
    assert kind_of(bytes([first, 0, 0])) == kind


def test_nothing_at_all_is_control() -> None:
    assert kind_of(b"") == "control"


def request(username: str) -> bytes:
    message = stun.Message(message_method=stun.Method.BINDING, message_class=stun.Class.REQUEST)
    message.attributes["PRIORITY"] = 1
    message.attributes["USERNAME"] = username
    return bytes(message)


@given(st.text(min_size=1, max_size=30))
def test_a_checks_names_are_read_behind_other_attributes(username: str) -> None:
    assert stun_username(request(username)) == username


def test_an_answer_has_no_names_and_what_is_cut_short_neither() -> None:
    answer = stun.Message(message_method=stun.Method.BINDING, message_class=stun.Class.RESPONSE)
    answer.attributes["USERNAME"] = "a:b"
    assert stun_username(bytes(answer)) is None
    whole = request("console:client")
    assert stun_username(whole[:24]) is None
    assert stun_username(whole[:10]) is None


@given(st.binary(max_size=100))
def test_any_bytes_can_be_looked_at(data: bytes) -> None:
    kind_of(data)
    stun_username(data)
    stun_username(struct.pack("!HH", 1, len(data)) + b"\x21\x12\xa4\x42" + bytes(12) + data)
