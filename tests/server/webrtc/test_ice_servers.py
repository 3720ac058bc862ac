import pytest

from lockstep.server.webrtc.ice_servers import (
    IceServer,
    IceServers,
    ice_servers,
    link_headers,
    read_turn_uri,
    turn_credential,
)

STUN, TURN = ("stun:stun.example.org",), ("turn:turn.example.org:3478?transport=udp", "turns:turn.example.org")


def test_a_credential_is_the_end_and_the_hmac_of_it() -> None:
    # With openssl: printf 1700000000:ann | openssl dgst -sha1 -hmac secret -binary | base64
    assert turn_credential("secret", "ann", 1700000000) == ("1700000000:ann", "vQnWXBtsqkQms4Ddse1rYmcjgqM=")


def test_without_any_server_there_is_nothing_to_use_and_nothing_that_expires() -> None:
    assert ice_servers((), (), "", 60, "ann", 0.0) == IceServers([], None)
    assert ice_servers(STUN, (), "", 60, "ann", 0.0) == IceServers([IceServer(list(STUN))], None)


def test_turn_servers_come_with_a_credential_that_ends() -> None:
    found = ice_servers(STUN, TURN, "secret", 60, "ann", 1000.9)
    assert found.expires == 1060
    assert found.ice_servers[1].urls == list(TURN)
    assert found.ice_servers[1].username == "1060:ann"


def test_link_headers_say_the_same() -> None:
    lines = link_headers(ice_servers(STUN, TURN[:1], "secret", 60, "ann", 1000.0))
    assert lines[0] == '<stun:stun.example.org>; rel="ice-server"'
    assert lines[1].startswith(
        '<turn:turn.example.org:3478?transport=udp>; rel="ice-server"; username="1060:ann"; credential="'
    )
    assert lines[1].endswith('"; credential-type="password"')


@pytest.mark.parametrize(
    ("uri", "parts"),
    [
        ("turn:a.example", ("turn", "a.example", 3478, "udp")),
        ("turn:192.0.2.1:99?transport=tcp", ("turn", "192.0.2.1", 99, "tcp")),
        ("turns:[2001:db8::1]:443", ("turns", "2001:db8::1", 443, "tcp")),
        ("turns:a", ("turns", "a", 5349, "tcp")),
    ],
)
def test_a_turn_uri_is_taken_apart(uri: str, parts: tuple[str, str, int, str]) -> None:
    assert read_turn_uri(uri) == parts


@pytest.mark.parametrize("uri", ["", "turn:", "http://a", "turn:a:b", "turn:a?transport=quic", "turn:a b", "turn://a"])
def test_what_is_no_turn_uri_is_refused(uri: str) -> None:
    with pytest.raises(ValueError, match="is not turn"):
        read_turn_uri(uri)
