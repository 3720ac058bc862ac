import random
import time
from collections.abc import Sequence

import pytest
from cryptography.hazmat.primitives.asymmetric import rsa
from hypothesis import given, settings
from hypothesis import strategies as st

from lockstep.rtc.certificate import Certificate
from lockstep.rtc.dtls import (
    DtlsClosed,
    DtlsConnected,
    DtlsConnection,
    DtlsData,
    DtlsFailed,
    DtlsMessageTooLong,
    DtlsNotConnected,
    DtlsSettings,
    DtlsState,
    dtls_context,
    records,
)
from lockstep.rtc.fingerprint import Fingerprint
from tests.rtc.dtls_pair import DtlsPair

NOW = 0.0


def keys_fit(pair: DtlsPair) -> bool:
    client, server = pair.client_events[0], pair.server_events[0]
    assert isinstance(client, DtlsConnected)
    assert isinstance(server, DtlsConnected)
    assert client.srtp is not None
    assert server.srtp is not None
    assert client.srtp.local != client.srtp.remote
    return (client.srtp.local, client.srtp.remote) == (server.srtp.remote, server.srtp.local)


def test_both_ends_connect_with_the_same_srtp_keys() -> None:
    pair = DtlsPair()
    pair.connect()
    assert keys_fit(pair)
    assert pair.client.timer() is None
    assert pair.server.timer() is None


@pytest.mark.parametrize("rsa_is", ["client", "server", "both"])
def test_a_peer_with_an_rsa_certificate_connects(rsa_is: str) -> None:
    certificate = Certificate.for_key(rsa.generate_private_key(65537, 2048))
    pair = DtlsPair(
        client=certificate if rsa_is != "server" else None, server=certificate if rsa_is != "client" else None
    )
    pair.connect()
    assert keys_fit(pair)


def test_no_datagram_of_a_handshake_is_longer_than_the_mtu() -> None:
    pair = DtlsPair(settings=DtlsSettings(mtu=300))
    pair.connect()
    assert max(map(len, pair.sent)) <= 300
    assert len(pair.sent) < sum(len(list(records(each))) for each in pair.sent)  # and records do share datagrams


def test_every_record_of_a_datagram_is_read() -> None:
    pair = DtlsPair()
    pair.connect()
    for text in (b"one", b"two", b"three"):
        pair.client.send(text, NOW)
    datagrams = pair.client.datagrams_to_send()
    assert len(datagrams) == 3  # each alone: other stacks read one record of a datagram
    pair.server.receive_datagram(b"".join(datagrams), NOW)
    assert pair.server.events() == [DtlsData(b"one"), DtlsData(b"two"), DtlsData(b"three")]


def test_the_first_record_is_there_before_the_others_are_read_and_all_before_the_next_datagram() -> None:
    pair = DtlsPair()
    pair.connect()
    for text in (b"one", b"two", b"three", b"four", b"five"):
        pair.client.send(text, NOW)
    datagrams = pair.client.datagrams_to_send()
    pair.server.receive_first(b"".join(datagrams[:3]), NOW)
    assert pair.server.events() == [DtlsData(b"one")]
    pair.server.read_on(NOW)
    assert pair.server.events() == [DtlsData(b"two"), DtlsData(b"three")]
    pair.server.receive_first(datagrams[3], NOW)
    pair.server.receive_first(datagrams[4], NOW)
    assert pair.server.events() == [DtlsData(b"four"), DtlsData(b"five")]


def test_an_answer_to_a_repeated_handshake_does_not_share_the_datagram_of_the_next_message() -> None:
    pair = DtlsPair()
    pair.start()
    finished: list[bytes] = []
    for _ in range(3):
        for data in pair.client.datagrams_to_send():
            pair.server.receive_datagram(data, NOW)
        if pair.server.state is DtlsState.CONNECTED:
            break
        for data in pair.server.datagrams_to_send():
            pair.client.receive_datagram(data, NOW)
    answer = pair.server.datagrams_to_send()  # late: the client repeats its last flight first
    while not finished:
        time.sleep(max(0.0, (pair.client.timer() or 0.0) - time.monotonic()))
        pair.client.handle_timer(time.monotonic())
        finished = pair.client.datagrams_to_send()
    for data in answer:
        pair.client.receive_datagram(data, NOW)
    pair.client.send(b"command", NOW)
    pair.server.events()
    pair.server.receive_first(b"".join((*finished, *pair.client.datagrams_to_send())), NOW)
    assert pair.server.events() == [DtlsData(b"command")]
    pair.server.send(b"feedback", NOW)
    *again, feedback = pair.server.datagrams_to_send()
    assert again
    assert len(list(records(feedback))) == 1
    for data in (*again, feedback):
        pair.client.receive_datagram(data, NOW)
    assert pair.client.events()[-1] == DtlsData(b"feedback")


def test_a_goodbye_behind_data_is_heard_with_the_rest_of_the_datagram() -> None:
    pair = DtlsPair()
    pair.connect()
    pair.client.send(b"last", NOW)
    pair.client.close(NOW)
    pair.server.receive_first(b"".join(pair.client.datagrams_to_send()), NOW)
    assert pair.server.events() == [DtlsData(b"last")]
    pair.server.read_on(NOW)
    assert pair.server.events() == [DtlsClosed()]
    assert pair.server.state is DtlsState.CLOSED


def test_application_data_right_behind_the_handshake_is_not_lost() -> None:
    pair = DtlsPair()
    pair.start()
    pair.server.receive_datagram(b"".join(pair.client.datagrams_to_send()), NOW)
    for data in pair.server.datagrams_to_send():
        pair.client.receive_datagram(data, NOW)
    for data in pair.client.datagrams_to_send():
        pair.server.receive_datagram(data, NOW)
    pair.server.send(b"at once", NOW)
    for data in pair.server.datagrams_to_send():
        pair.client.receive_datagram(data, NOW)
    assert [type(each) for each in pair.client.events()] == [DtlsConnected, DtlsData]


def test_application_data_before_the_end_of_the_handshake_is_kept_whole() -> None:
    pair = DtlsPair()
    pair.start()
    pair.server.receive_datagram(b"".join(pair.client.datagrams_to_send()), NOW)
    for data in pair.server.datagrams_to_send():
        pair.client.receive_datagram(data, NOW)
    for data in pair.client.datagrams_to_send():
        pair.server.receive_datagram(data, NOW)
    handshake = pair.server.datagrams_to_send()
    pair.server.send(bytes(5000), NOW)
    for data in [*pair.server.datagrams_to_send(), *handshake]:
        pair.client.receive_datagram(data, NOW)
    assert len(max(handshake, key=len)) < 5000
    assert pair.client.events()[1:] == [DtlsData(bytes(5000))]


def test_a_datagram_of_data_with_a_record_that_was_changed_gives_the_others() -> None:
    pair = DtlsPair()
    pair.connect()
    for text in (b"one", b"two", b"three"):
        pair.client.send(text, NOW)
    first, second, third = pair.client.datagrams_to_send()
    pair.server.receive_datagram(first + second[:-1] + bytes((second[-1] ^ 1,)) + third, NOW)
    assert pair.server.events() == [DtlsData(b"one"), DtlsData(b"three")]
    pair.client.send(b"four", NOW)
    pair.server.receive_datagram(pair.client.datagrams_to_send()[0], NOW)
    assert pair.server.events() == [DtlsData(b"four")]


@pytest.mark.parametrize("version", [b"\xfe\xff", b"\x00\x00", b"\x03\x03"])
def test_records_in_the_content_of_a_malformed_one_are_all_read_at_once(version: bytes) -> None:
    """OpenSSL skips the malformed header alone. What it did not read would fill its buffer for ever."""
    pair = DtlsPair()
    pair.connect()
    for number in range(20):
        pair.client.send(b"%d" % number, NOW)
    inner = b"".join(pair.client.datagrams_to_send())
    header = b"\x17" + version + inner[3:11] + len(inner).to_bytes(2, "big")
    pair.server.receive_datagram(header + inner, NOW)
    assert pair.server.events() == [DtlsData(b"%d" % number) for number in range(20)]
    pair.client.send(b"next", NOW)
    pair.server.receive_datagram(pair.client.datagrams_to_send()[0], NOW)
    assert pair.server.events() == [DtlsData(b"next")]


@pytest.mark.parametrize("lost", range(8))
def test_a_lost_datagram_of_the_handshake_is_sent_again(lost: int) -> None:
    pair = DtlsPair(settings=DtlsSettings(mtu=600))
    pair.start()

    def arrives(number: int, data: bytes) -> Sequence[bytes]:
        return [] if number == lost else [data]

    pair.exchange(arrives)
    pair.repeat_until_connected()
    assert keys_fit(pair)


def test_a_timer_that_is_handled_too_early_sends_nothing_and_stays() -> None:
    pair = DtlsPair()
    pair.start()
    pair.client.datagrams_to_send()
    pair.client.handle_timer(NOW)
    assert pair.client.datagrams_to_send() == []
    assert pair.client.timer() is not None


def test_doubled_and_reordered_datagrams_do_no_harm() -> None:
    pair = DtlsPair(settings=DtlsSettings(mtu=300))
    order = random.Random(7)
    pair.start()
    while flight := [(pair.server, each) for each in pair.client.datagrams_to_send()] + [
        (pair.client, each) for each in pair.server.datagrams_to_send()
    ]:
        doubled = flight * 2
        order.shuffle(doubled)
        for target, data in doubled:
            target.receive_datagram(data, NOW)
    pair.repeat_until_connected()
    assert keys_fit(pair)


def test_a_certificate_that_was_not_announced_ends_it_by_name() -> None:
    pair = DtlsPair(expected=[Certificate.generate().fingerprint])
    pair.start()
    pair.exchange()
    assert [type(each) for each in pair.client_events] == [DtlsFailed]
    assert isinstance(pair.client_events[0], DtlsFailed)
    assert pair.client_events[0].reason == "fingerprint"
    assert pair.client.state is DtlsState.FAILED
    with pytest.raises(DtlsNotConnected):
        pair.client.send(b"secret", NOW)


@pytest.mark.parametrize("expected", [[], [Fingerprint("sha-1", "AB:" * 19 + "AB")]])
def test_a_peer_without_a_usable_fingerprint_is_not_trusted(expected: list[Fingerprint]) -> None:
    pair = DtlsPair(expected=expected)
    pair.start()
    pair.exchange()
    assert pair.client.state is DtlsState.FAILED


def test_close_notify_ends_both() -> None:
    pair = DtlsPair()
    pair.connect()
    pair.client.close(NOW)
    pair.client.close(NOW)
    pair.exchange()
    assert pair.server_events[1:] == [DtlsClosed()]
    assert pair.client.state is pair.server.state is DtlsState.CLOSED
    pair.server.receive_datagram(b"\x16", NOW)
    assert pair.server.counts == {"ended": 1}
    assert pair.client.timer() is pair.server.timer() is None


def test_a_connection_that_never_started_closes() -> None:
    connection = DtlsPair().client
    connection.close(NOW)
    connection.start(NOW)
    assert connection.state is DtlsState.CLOSED
    assert connection.datagrams_to_send() == []


def test_what_is_not_dtls_and_what_is_too_early_is_dropped_and_counted() -> None:
    connection = DtlsPair().server
    connection.receive_datagram(b"\x16", NOW)
    connection.start(NOW)
    connection.receive_datagram(b"", NOW)
    connection.receive_datagram(b"\x80rtp", NOW)
    assert connection.counts == {"not_started": 1, "not_dtls": 2}
    assert connection.events() == []


def test_sending_before_connected_and_too_much_are_named_errors() -> None:
    pair = DtlsPair()
    with pytest.raises(DtlsNotConnected, match="new"):
        pair.client.send(b"", NOW)
    pair.connect()
    pair.client.send(b"", NOW)
    pair.client.send(bytes(16384), NOW)
    with pytest.raises(DtlsMessageTooLong, match="16385 bytes"):
        pair.client.send(bytes(16385), NOW)
    pair.exchange()
    assert pair.server_events[1:] == [DtlsData(bytes(16384))]


def test_a_handshake_without_an_end_is_ended() -> None:
    pair = DtlsPair(settings=DtlsSettings(max_handshake=10_000))
    pair.start()
    [hello] = pair.client.datagrams_to_send()
    for _ in range(10_000 // len(hello) + 1):
        pair.server.receive_datagram(hello, NOW)
    failed = [each for each in pair.server.events() if isinstance(each, DtlsFailed)]
    assert [each.reason for each in failed] == ["too_much_handshake"]


def test_a_hello_that_is_nonsense_ends_the_handshake_by_name() -> None:
    server = DtlsPair().server
    server.start(NOW)
    server.receive_datagram(bytes.fromhex("16feff0000000000000000000c") + bytes(12), NOW)
    [failed] = server.events()
    assert isinstance(failed, DtlsFailed)
    assert failed.reason == "protocol"
    assert failed.detail


CONNECTED = DtlsPair()
CONNECTED.connect()
CONNECTED.client.send(b"before", NOW)
[RECORD] = CONNECTED.client.datagrams_to_send()


@settings(deadline=None)
@given(st.binary(min_size=1, max_size=100), st.integers(20, 63))
def test_strangers_cannot_end_a_connection_with_any_bytes(data: bytes, first: int) -> None:
    CONNECTED.server.receive_datagram(bytes((first,)) + data, NOW)
    assert CONNECTED.server.events() == []
    assert CONNECTED.server.state is DtlsState.CONNECTED


@settings(deadline=None)
@given(st.integers(0, len(RECORD) - 1), st.integers(1, 255))
def test_a_changed_record_is_dropped(position: int, change: int) -> None:
    changed = bytearray(RECORD)
    changed[position] ^= change
    CONNECTED.server.receive_datagram(bytes(changed), NOW)
    assert CONNECTED.server.events() == []
    assert CONNECTED.server.state is DtlsState.CONNECTED


@settings(deadline=None)
@given(st.lists(st.binary(max_size=200), max_size=5))
def test_no_bytes_before_the_handshake_raise(datagrams: list[bytes]) -> None:
    server = DtlsConnection(CONTEXT, "server", [])
    server.start(NOW)
    for data in datagrams:
        server.receive_datagram(b"\x16\xfe\xfd" + data, NOW)
    assert not any(isinstance(each, DtlsConnected) for each in server.events())


CONTEXT = dtls_context(Certificate.generate())
