from collections import Counter
from contextlib import suppress
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.rtc.stun import Kind, Message, serialize, transaction_of
from lockstep.rtc.turn.servers import (
    MAX_SERVERS,
    IceServer,
    MappedAddress,
    ServerUri,
    ServerUriError,
    parse_server_uri,
    server_uris,
)


@pytest.mark.parametrize(
    ("text", "uri"),
    [
        ("stun:stun.example", ServerUri("stun", "stun.example", 3478, "udp", False)),
        ("turn:[2001:db8::1]:1234?transport=tcp", ServerUri("turn", "2001:db8::1", 1234, "tcp", False)),
        ("turns:192.0.2.1", ServerUri("turn", "192.0.2.1", 5349, "tcp", True)),
        ("TURN:host?transport=UDP", ServerUri("turn", "host", 3478, "udp", False)),
    ],
)
def test_a_uri_is_read(text: str, uri: ServerUri) -> None:
    assert parse_server_uri(text) == uri


@pytest.mark.parametrize(
    "text", ["", "http://host", "turn:", "turn:host:0", "turn:host:70000", "turn:a b", "turn:h?x=y"]
)
def test_what_is_no_uri_is_said(text: str) -> None:
    with pytest.raises(ServerUriError):
        parse_server_uri(text)


@given(st.text() | st.from_regex(r"\A(turn|stun)s?:.{0,20}\Z"))
def test_no_text_raises_anything_else(text: str) -> None:
    with suppress(ServerUriError):
        parse_server_uri(text)


def test_servers_that_cannot_be_asked_are_counted_and_the_others_bounded() -> None:
    counts: Counter[str] = Counter()
    several = [f"stun:host{number}" for number in range(20)]
    servers = [
        IceServer(["turn:nobody", "nonsense", "stuns:host", "turns:host?transport=udp"]),
        IceServer(["turn:host"], "user", "secret"),
        IceServer(["turn:host"], "user", "another"),
        IceServer(several),
    ]
    found = server_uris(servers, counts)
    assert found[0][1].credential == "secret"
    assert len(found) == MAX_SERVERS
    assert counts == {"server_without_credentials": 1, "server_malformed": 1, "server_unsupported": 2}


def test_a_stun_server_says_which_address_it_sees() -> None:
    core = MappedAddress(Random(1).randbytes)
    core.start(0.0)
    core.data_to_send()
    core.handle_timer(0.5)
    [again] = core.data_to_send()
    head = transaction_of(again)
    assert head is not None
    core.receive(serialize(Message(Kind.SUCCESS, head[1], mapped=("203.0.113.9", 77))), 0.6)
    assert (core.mapped, core.done, core.timer()) == (("203.0.113.9", 77), True, None)


def test_a_stun_server_that_says_nothing_is_given_up() -> None:
    core = MappedAddress(Random(1).randbytes)
    core.start(0.0)
    while (due := core.timer()) is not None:
        core.handle_timer(due)
    assert (core.mapped, core.done) == (None, True)
