"""An address on a TURN server, on a virtual clock."""

from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.rtc.stun import StunErrorCode
from lockstep.rtc.turn.allocation import Allocated, Allocation, AllocationEnded
from lockstep.rtc.turn.messages import Method, TurnStream, pack_channel_data
from lockstep.rtc.turn.settings import TurnSettings
from tests.rtc.turn.server import MAPPED, RELAYED, TurnServer

PEER, OTHER = ("192.0.2.5", 4000), ("192.0.2.6", 4000)


class Pair:
    """A client and a server with no delay between them."""

    def __init__(self, server: TurnServer | None = None, *, password: str = "password", reliable: bool = False) -> None:
        self.now = 100.0
        self.lost = False
        self.sent = 0
        self.server = server or TurnServer()
        self.client = Allocation("user", password, Random(1).randbytes, reliable=reliable)
        self.client.start(self.now)
        self.exchange()

    def exchange(self) -> None:
        while messages := self.client.data_to_send():
            self.sent += len(messages)
            for message in messages if not self.lost else ():
                for answer in self.server.answer(message):
                    self.client.receive(answer, self.now)

    def run(self, seconds: float) -> None:
        end = self.now + seconds
        while (due := self.client.timer()) is not None and due <= end:
            self.now = max(self.now, due)
            self.client.handle_timer(self.now)
            self.exchange()
        self.now = end

    def send(self, data: bytes, peer: tuple[str, int] = PEER) -> None:
        self.client.send(data, peer, self.now)
        self.exchange()


def test_a_client_with_credentials_gets_an_address() -> None:
    pair = Pair()
    assert pair.client.events() == [Allocated(RELAYED, MAPPED)]
    assert pair.client.relayed == RELAYED
    assert pair.server.methods == [Method.ALLOCATE, Method.ALLOCATE], "first without credentials, RFC 8489 9.2.3"


def test_a_wrong_password_is_asked_for_once_and_ends_it() -> None:
    pair = Pair(password="another")
    assert pair.client.events() == [AllocationEnded(StunErrorCode(401, "no"))]
    assert pair.server.methods == [Method.ALLOCATE, Method.ALLOCATE]
    pair.run(100)
    assert pair.sent == 2


def test_what_is_sent_before_a_channel_is_bound_waits_for_it_and_the_rest_goes_at_once() -> None:
    pair = Pair()
    for data in (b"one", b"two"):
        pair.client.send(data, PEER, pair.now)
    pair.exchange()
    pair.send(b"three")
    pair.send(b"to another", OTHER)
    assert pair.server.relayed == [(b"one", PEER), (b"two", PEER), (b"three", PEER), (b"to another", OTHER)]
    assert pair.server.methods.count(Method.CHANNEL_BIND) == 2


def test_what_a_peer_sends_comes_with_its_address_by_channel_and_by_indication() -> None:
    pair = Pair()
    pair.client.receive(pair.server.from_peer(b"a stranger", PEER), pair.now)
    assert pair.client.received() == []
    assert pair.client.counts["indication"] == 1
    pair.send(b"x")
    pair.client.receive(pair.server.from_peer(b"hello", PEER), pair.now)
    pair.server.channels.clear()
    pair.client.receive(pair.server.from_peer(b"again", PEER), pair.now)
    assert pair.client.received() == [(b"hello", PEER), (b"again", PEER)]


def test_a_peer_that_the_server_refuses_is_left_alone_for_a_while() -> None:
    pair = Pair()
    pair.server.refuses = {Method.CHANNEL_BIND: 403}
    for _ in range(5):
        pair.send(b"x")
    assert pair.server.methods.count(Method.CHANNEL_BIND) == 1
    assert pair.client.counts["refused"] == 4
    pair.server.refuses = {}
    pair.run(31)
    pair.send(b"later")
    assert pair.server.relayed == [(b"later", PEER)]


def test_address_and_channels_are_refreshed_for_as_long_as_it_lives() -> None:
    pair = Pair(TurnServer(lifetime=100))
    pair.send(b"x")
    pair.run(1000)
    assert pair.server.methods.count(Method.REFRESH) == 20
    assert pair.server.asked == [600] + [100] * 20
    assert pair.server.methods.count(Method.CHANNEL_BIND) == 5
    pair.send(b"y")
    assert pair.server.relayed[-1] == (b"y", PEER)


def test_a_new_nonce_is_taken() -> None:
    pair = Pair()
    pair.server.nonce = b"second"
    pair.send(b"x")
    assert pair.server.relayed == [(b"x", PEER)]


def test_a_network_that_is_cut_during_a_refresh_ends_nothing() -> None:
    pair = Pair(TurnServer(lifetime=600))
    pair.client.events()
    pair.lost = True
    pair.run(520)
    pair.lost = False
    pair.run(30)
    assert pair.client.events() == []
    assert pair.client.relayed == RELAYED
    assert Method.REFRESH in pair.server.methods


def test_an_allocation_that_the_server_has_forgotten_ends_by_name() -> None:
    pair = Pair()
    pair.client.events()
    pair.server.refuses = {Method.REFRESH: 437}
    pair.run(600)
    assert pair.client.events() == [AllocationEnded(StunErrorCode(437, "no"))]
    assert pair.client.relayed is None
    pair.send(b"x")
    assert pair.client.counts["not_allocated"] == 1


@pytest.mark.parametrize(("reliable", "requests"), [(False, 7), (True, 1)])
def test_a_server_that_says_nothing_is_given_up_after_40_s(reliable: bool, requests: int) -> None:
    client = Allocation("user", "password", Random(1).randbytes, reliable=reliable)
    client.start(0.0)
    sent = len(client.data_to_send())
    now = 0.0
    while (due := client.timer()) is not None:
        now = due
        client.handle_timer(now)
        sent += len(client.data_to_send())
    assert (sent, now) == (requests, 39.5)
    assert client.events() == [AllocationEnded(StunErrorCode(408, "no answer"))]


def test_an_answer_that_somebody_else_made_counts_for_nothing() -> None:
    pair = Pair()
    pair.client.send(b"x", PEER, pair.now)
    [request] = pair.client.data_to_send()
    pair.client.receive(TurnServer(password="another").success(Method.CHANNEL_BIND, request[8:20], _bound()), pair.now)
    assert pair.client.counts["unauthentic"] == 1
    assert pair.client.data_to_send() == []


def _bound() -> dict[int, bytes]:
    return {0x0012: bytes((0, 1)) + bytes(6), 0x000C: b"\x40\x00\x00\x00"}


def test_peers_and_what_waits_for_them_are_bounded() -> None:
    pair = Pair()
    pair.lost = True
    limits = TurnSettings()
    for number in range(limits.max_peers + 3):
        for _ in range(limits.max_waiting + 2):
            pair.client.send(b"x", ("192.0.2.7", 1000 + number), pair.now)
    assert pair.client.counts["peers"] == 3 * (limits.max_waiting + 2)
    assert pair.client.counts["waiting"] == 2 * limits.max_peers


def test_closing_gives_it_back() -> None:
    pair = Pair()
    pair.client.close(pair.now)
    pair.exchange()
    assert pair.server.closed
    assert pair.client.timer() is None


def test_messages_on_a_stream_are_found_however_they_are_cut() -> None:
    server = TurnServer()
    pair = Pair(server, reliable=True)
    pair.send(b"12345")
    assert server.relayed == [(b"12345", PEER)]
    messages = [server.error(Method.REFRESH, bytes(12), 400), pack_channel_data(0x4000, b"12345", padded=True)]
    for size in (1, 3, 100):
        stream, found = TurnStream(), []
        text = b"".join(messages * 2)
        for start in range(0, len(text), size):
            found += stream.receive_bytes(text[start : start + size])
        assert found == messages * 2
        assert not stream.broken


@given(st.lists(st.binary(max_size=64), max_size=20))
def test_nothing_that_a_server_says_raises(messages: list[bytes]) -> None:
    pair = Pair()
    stream = TurnStream()
    for message in messages:
        pair.client.receive(message, pair.now)
        pair.client.receive(b"\x40\x00" + message, pair.now)
        pair.client.receive(b"\x01\x01\x00\x00\x21\x12\xa4\x42" + message, pair.now)
        stream.receive_bytes(message)
    pair.run(10)
