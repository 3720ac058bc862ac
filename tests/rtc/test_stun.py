import ipaddress
from contextlib import suppress
from dataclasses import replace
from typing import Any

import aioice.stun
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.rtc.stun import (
    MAX_MESSAGE,
    Kind,
    Message,
    StunError,
    StunErrorCode,
    is_authentic,
    parse,
    serialize,
    transaction_of,
    username_of,
)

# RFC 5769 2.1 to 2.3
TRANSACTION = bytes.fromhex("b7e7a701bc34d686fa87dfae")
PASSWORD = "VOkJxbRl1RmTxUk/WvJxBt"
REQUEST = bytes.fromhex(
    "000100582112a442b7e7a701bc34d686fa87dfae802200105354554e207465737420636c69656e74002400046e0001ff80290008932ff9b1"
    "51263b36000600096576746a3a68367659202020000800149aeaa70cbfd8cb56781ef2b5b2d3f249c1b571a280280004e57a3bcf"
)
RESPONSE_IPV4 = bytes.fromhex(
    "0101003c2112a442b7e7a701bc34d686fa87dfae8022000b7465737420766563746f7220002000080001a147e112a643000800142b91f599"
    "fd9e90c38c7489f92af9ba53f06be7d780280004c07d4c96"
)
RESPONSE_IPV6 = bytes.fromhex(
    "010100482112a442b7e7a701bc34d686fa87dfae8022000b7465737420766563746f7220002000140002a1470113a9faa5d3f179bc25f4b5"
    "bed2b9d900080014a382954e4be67bf11784c97c8292c275bfe3ed4180280004c8fb0b4c"
)

numbers = st.integers
addresses = st.tuples(st.ip_addresses().map(str), numbers(0, 65535))
messages = st.builds(
    Message,
    kind=st.sampled_from(Kind),
    transaction=st.binary(min_size=12, max_size=12),
    method=numbers(0, 0xFFF),
    username=st.none() | st.text(max_size=100),
    priority=st.none() | numbers(0, 2**32 - 1),
    use_candidate=st.booleans(),
    controlling=st.none() | numbers(0, 2**64 - 1),
    controlled=st.none() | numbers(0, 2**64 - 1),
    mapped=st.none() | addresses,
    error=st.none() | st.builds(StunErrorCode, numbers(300, 699), st.text(max_size=100)),
    unknown_attributes=st.lists(numbers(0, 65535), max_size=10).map(tuple),
)


def message_of(*attributes: bytes) -> bytes:
    body = b"".join(attributes)
    return bytes.fromhex("0001") + len(body).to_bytes(2) + bytes.fromhex("2112a442") + TRANSACTION + body


def test_the_request_of_the_rfc_is_read() -> None:
    assert parse(REQUEST) == Message(
        Kind.REQUEST, TRANSACTION, username="evtj:h6vY", priority=0x6E0001FF, controlled=0x932FF9B151263B36
    )


@pytest.mark.parametrize(
    ("data", "host"), [(RESPONSE_IPV4, "192.0.2.1"), (RESPONSE_IPV6, "2001:db8:1234:5678:11:2233:4455:6677")]
)
def test_the_responses_of_the_rfc_are_read(data: bytes, host: str) -> None:
    assert parse(data) == Message(Kind.SUCCESS, TRANSACTION, mapped=(host, 32853))


@pytest.mark.parametrize("data", [REQUEST, RESPONSE_IPV4, RESPONSE_IPV6])
def test_the_integrity_of_the_rfc_holds_for_its_password_alone(data: bytes) -> None:
    assert is_authentic(data, PASSWORD)
    assert not is_authentic(data, PASSWORD + "x")


@given(messages, st.none() | st.text(max_size=50))
def test_a_message_survives_being_written_and_read(message: Message, password: str | None) -> None:
    data = serialize(message, password)
    assert parse(data) == message
    assert is_authentic(data, password or "") is (password is not None)


@given(messages)
def test_another_implementation_reads_what_is_written(message: Message) -> None:
    message = replace(message, method=1, error=None, unknown_attributes=())
    read = aioice.stun.parse_message(serialize(message, "secret"))
    assert read.check_message_integrity(b"secret")
    found: dict[str, Any] = dict(read.attributes)
    assert read.transaction_id == message.transaction
    assert found.get("USERNAME") == message.username
    assert found.get("PRIORITY") == message.priority
    assert ("USE-CANDIDATE" in found) is message.use_candidate
    assert found.get("ICE-CONTROLLING") == message.controlling
    mapped = found.get("XOR-MAPPED-ADDRESS")
    assert (mapped and (str(ipaddress.ip_address(mapped[0])), mapped[1])) == message.mapped


@given(st.binary(max_size=MAX_MESSAGE + 10))
def test_any_bytes_are_a_message_or_the_one_error(data: bytes) -> None:
    for each in (data, message_of(data)):
        with suppress(StunError):
            parse(each)


@given(numbers(0, len(REQUEST) * 8 - 1))
def test_a_request_with_one_bit_changed_says_nothing_else(bit: int) -> None:
    changed = bytearray(REQUEST)
    changed[bit // 8] ^= 1 << bit % 8
    try:
        found = parse(bytes(changed))  # unless the bit is one of the fingerprint's head
    except StunError:
        return
    assert found == parse(REQUEST) or not is_authentic(bytes(changed), PASSWORD)


@given(numbers(0, 79 * 8))
def test_without_the_fingerprint_the_integrity_sees_a_changed_bit(bit: int) -> None:
    message = Message(Kind.REQUEST, TRANSACTION, username="evtj:h6vY", priority=5, use_candidate=True)
    data = bytearray(serialize(message, PASSWORD)[:-8])
    data[2:4] = (len(data) - 20).to_bytes(2)
    assert is_authentic(bytes(data), PASSWORD)
    bit %= (len(data) - 24) * 8
    data[bit // 8] ^= 1 << bit % 8
    try:
        parse(bytes(data))
    except StunError:
        return
    assert not is_authentic(bytes(data), PASSWORD)


@pytest.mark.parametrize(
    "data",
    [
        pytest.param(REQUEST[:19], id="short"),
        pytest.param(REQUEST + bytes(4), id="more than the header says"),
        pytest.param(b"\x80" + REQUEST[1:], id="RTP"),
        pytest.param(REQUEST[:4] + bytes(4) + REQUEST[8:], id="no cookie"),
        pytest.param(message_of(bytes.fromhex("00060008") + b"abcd"), id="beyond the end"),
        pytest.param(message_of(bytes.fromhex("00060001ff000000")), id="not UTF-8"),
        pytest.param(message_of(bytes.fromhex("0024000200010000")), id="priority of two bytes"),
        pytest.param(message_of(bytes.fromhex("0025000100000000")), id="flag with a value"),
        pytest.param(message_of(bytes.fromhex("0020000800030000") + bytes(4)), id="a third family"),
        pytest.param(message_of(bytes.fromhex("0020000800020000") + bytes(4)), id="a short IPv6 address"),
        pytest.param(message_of(bytes.fromhex("0009000400000200")), id="error 200"),
        pytest.param(message_of(bytes.fromhex("0009000400000464")), id="error 4 and 100"),
        pytest.param(message_of(bytes.fromhex("000a000100000000")), id="half an attribute type"),
        pytest.param(message_of(bytes.fromhex("80280004") + bytes(4)), id="false fingerprint"),
        pytest.param(message_of(bytes.fromhex("80280004") + bytes(4), bytes.fromhex("80220000")), id="not the last"),
        pytest.param(message_of(bytes.fromhex("80220000") * 33), id="33 attributes"),
        pytest.param(message_of(bytes.fromhex("802205dc") + bytes(1500)), id="long"),
    ],
)
def test_what_is_malformed_is_refused_by_name(data: bytes) -> None:
    with pytest.raises(StunError):
        parse(data)


@pytest.mark.parametrize(
    "message",
    [
        Message(Kind.REQUEST, b"short"),
        Message(Kind.REQUEST, TRANSACTION, method=0x1000),
        Message(Kind.REQUEST, TRANSACTION, priority=-1),
        Message(Kind.REQUEST, TRANSACTION, controlling=1 << 64),
        Message(Kind.REQUEST, TRANSACTION, username="x" * 600),
        Message(Kind.REQUEST, TRANSACTION, username="\ud800"),
        Message(Kind.SUCCESS, TRANSACTION, mapped=("example.org", 1)),
        Message(Kind.SUCCESS, TRANSACTION, mapped=("192.0.2.1", 70000)),
        Message(Kind.ERROR, TRANSACTION, error=StunErrorCode(200)),
        Message(Kind.ERROR, TRANSACTION, unknown_attributes=tuple(range(700))),
    ],
)
def test_what_no_message_can_hold_is_refused_by_name(message: Message) -> None:
    with pytest.raises(StunError):
        serialize(message)


def test_unknown_attributes_that_must_be_understood_are_named_and_others_are_not() -> None:
    data = message_of(bytes.fromhex("7fff0000"), bytes.fromhex("c0570004") + bytes(4))
    assert parse(data).not_understood == (0x7FFF,)


def test_what_follows_the_integrity_does_not_count() -> None:
    data = message_of(bytes.fromhex("00080014") + bytes(20), bytes.fromhex("00250000"), bytes.fromhex("7fff0000"))
    assert not parse(data).use_candidate
    assert parse(data).not_understood == ()


def test_the_first_of_two_attributes_counts() -> None:
    data = message_of(bytes.fromhex("0024000400000001"), bytes.fromhex("0024000400000002"))
    assert parse(data).priority == 1


def test_an_empty_integrity_is_no_integrity() -> None:
    data = message_of(bytes.fromhex("00080000"))
    assert not is_authentic(data, PASSWORD)
    assert not is_authentic(message_of(), PASSWORD)


def test_the_first_look_agrees_with_the_whole_parser() -> None:
    assert transaction_of(REQUEST) == (Kind.REQUEST, TRANSACTION)
    assert transaction_of(RESPONSE_IPV4) == (Kind.SUCCESS, TRANSACTION)
    assert transaction_of(REQUEST[:12]) is None
    assert transaction_of(b"\x80" + REQUEST[1:]) is None
    assert username_of(REQUEST) == "evtj:h6vY"
    assert username_of(RESPONSE_IPV4) is None


@given(st.binary(max_size=200))
def test_the_first_look_withstands_any_bytes(data: bytes) -> None:
    for each in (data, REQUEST[:20] + data):
        transaction_of(each)
        username_of(each)
