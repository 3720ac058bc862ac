"""Pins what peer_guards_private.py relies on, and shows that each bound holds against a peer that does the thing."""

import asyncio
import os
import re
import socket
import time
from contextlib import ExitStack
from typing import Any, cast

import aioice.stun
import pytest
from aiortc import RTCConfiguration, RTCPeerConnection, RTCSessionDescription
from aiortc.rtcsctptransport import DataChunk, ForwardTsnChunk, InboundStream
from OpenSSL import SSL

from robot_bridge.protocol.console import Role
from robot_bridge.protocol.messages import Ping, Pong, StopTaken
from server import peer_guards_private
from server.access import Identity
from server.errors import TooManyPeers
from server.peer_guards_private import (
    CHECK_BURST,
    MAX_ADDRESSES,
    MAX_GAPS,
    MAX_STREAMS,
    RECEIVE_WINDOW,
    STRAY_BURST,
    guard_data,
    guard_ice,
)
from tests.server.rig import PATIENCE, Rig, TestPeer, eventually, running_rig

MOVED = "aiortc or aioice moved a private part: see server/peer_guards_private.py"


async def _ends(rig: Rig, name: str) -> None:
    async with asyncio.timeout(PATIENCE):
        await rig.services.console.peers.all_gone()
    assert rig.count("lockstep_bad_input_total", where="transport", reason=name) >= 1
    assert rig.count("lockstep_peers_ended_total", why="too much") == 1
    assert rig.count("lockstep_internal_errors_total", where="peer") == 0


def _sctp(peer: TestPeer) -> Any:
    return peer.pc.sctp


async def test_the_private_parts_are_where_they_were() -> None:
    async with running_rig() as rig, rig.peer("observer"):
        sctp: Any = rig.webrtc_peers[0].pc.sctp
        assert sctp._receive_data_chunk.__name__ == "take_bounded", MOVED
        assert sctp._receive_forward_tsn_chunk.__name__ == "forward_bounded", MOVED
        assert 0 < sctp._advertised_rwnd <= RECEIVE_WINDOW, MOVED
        assert all(isinstance(each, InboundStream) for each in sctp._inbound_streams.values()), MOVED
        assert isinstance(sctp._sack_misordered, set), MOVED
        connection = sctp.transport.transport._connection
        assert connection.check_incoming.__name__ == "check_bounded", MOVED
        assert connection._remote_candidates, MOVED
        assert {each._network_host for each in connection._remote_candidates} >= {"127.0.0.1"}, MOVED
        assert connection._nominated[1].remote_addr[0] == "127.0.0.1", MOVED


async def test_a_message_that_never_ends_is_not_kept() -> None:
    async with running_rig() as rig, rig.peer("observer") as peer:
        sctp = _sctp(peer)
        for number in range(RECEIVE_WINDOW // 1000 + 2):
            chunk = DataChunk(flags=2 if number == 0 else 0)  # it begins, and goes on
            chunk.tsn, chunk.stream_id, chunk.stream_seq, chunk.protocol = sctp._local_tsn, 1, 9, 51
            chunk.user_data = b"x" * 1000
            sctp._local_tsn = (sctp._local_tsn + 1) % 2**32
            await sctp._send_chunk(chunk)
            await asyncio.sleep(0)
        await _ends(rig, "receive_window")


async def test_holes_in_the_numbering_are_not_kept_without_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(peer_guards_private, "GIVEN_UP_SECONDS", 600.0)  # however slow this machine is
    async with running_rig() as rig, rig.peer("observer") as peer:
        sctp = _sctp(peer)
        for number in range(MAX_GAPS + 50):
            chunk = DataChunk(flags=3)
            chunk.tsn, chunk.stream_id = (sctp._local_tsn + 2 * number + 2) % 2**32, 1
            chunk.stream_seq, chunk.protocol, chunk.user_data = 500, 51, b"x"
            await sctp._send_chunk(chunk)
            await asyncio.sleep(0)
        await _ends(rig, "too_many_gaps")


async def test_a_peer_has_only_so_many_streams() -> None:
    async with running_rig() as rig, rig.peer("observer") as peer:
        sctp = _sctp(peer)
        for number in range(MAX_STREAMS + 3):
            chunk = DataChunk(flags=3)
            chunk.tsn, chunk.stream_id, chunk.stream_seq, chunk.protocol = sctp._local_tsn, 100 + number, 0, 51
            chunk.user_data = b"{}"
            sctp._local_tsn = (sctp._local_tsn + 1) % 2**32
            await sctp._send_chunk(chunk)
        await _ends(rig, "too_many_streams")


async def test_streams_that_are_only_skipped_count_as_well() -> None:
    async with running_rig() as rig, rig.peer("observer") as peer:
        sctp = _sctp(peer)
        chunk = ForwardTsnChunk()
        chunk.cumulative_tsn = sctp._local_tsn
        chunk.streams = [(number, 1) for number in range(MAX_STREAMS + 5)]
        await sctp._send_chunk(chunk)
        await _ends(rig, "too_many_streams")


def test_checks_from_ever_new_addresses_are_not_answered_with_checks_of_ours() -> None:
    class Candidate:
        def __init__(self, port: int) -> None:
            self.host, self.port = "192.0.2.1", port

    class Connection:
        def __init__(self) -> None:
            self._remote_candidates: list[Candidate] = []

        def check_incoming(self, message: object, address: tuple[str, int], protocol: object) -> None:
            self._remote_candidates.append(Candidate(address[1]))

    connection, refused = Connection(), list[str]()
    guard_ice(connection, refused.append)
    for port in range(MAX_ADDRESSES + 5):
        connection.check_incoming(None, ("192.0.2.1", port), None)
    assert len(connection._remote_candidates) == MAX_ADDRESSES
    assert refused == ["too_many_addresses"] * 5
    connection.check_incoming(None, ("192.0.2.1", 0), None)
    assert len(refused) == 5, "one that is known is answered"


async def test_a_peer_that_talks_nonsense_is_closed_and_nobody_else_is() -> None:
    async with running_rig(max_bad_messages=5) as rig, rig.peer("operator") as other, rig.peer("observer") as peer:
        for _ in range(30):
            peer.send_raw("session", os.urandom(9).hex())
        async with asyncio.timeout(PATIENCE):
            await peer.closed.wait()
        await other.feedback()
        await eventually(lambda: rig.count("lockstep_peers_ended_total", why="bad messages") == 1)
        assert 5 <= rig.count("lockstep_bad_input_total", where="session", reason="malformed") <= 30
        assert not other.closed.is_set()


async def test_an_observer_may_say_less_than_an_operator_but_always_stop() -> None:
    async with running_rig(max_observer_rate=2, max_bad_messages=1000) as rig, rig.peer("observer") as peer:
        for _ in range(20):
            peer.send_raw("control", '{"type":"ping","id":1}')
        peer.send_raw("control", '{"type":"stop","by":"","reason":"dog"}')
        await eventually(lambda: rig.services.console.clock.stop.stopped)
        assert rig.count("lockstep_bad_input_total", where="control", reason="flood") >= 15


async def test_a_malformed_stop_is_counted_and_stops_all_the_same_and_its_sender_hears_of_it_by_its_id() -> None:
    async with running_rig() as rig, rig.peer("observer") as peer:
        peer.send_raw("stop", '{"type":"stop","reason":5,"press":"my stop"}')
        taken = await peer.until(lambda each: isinstance(each, StopTaken))
        assert isinstance(taken, StopTaken)
        assert taken.press == "my stop"
        await eventually(lambda: rig.services.console.clock.stop.stopped)
        stop = rig.services.console.clock.stop
        assert (stop.reason, len(stop.press)) == ("5", 32)
        assert rig.count("lockstep_bad_input_total", where="stop", reason="malformed") == 1


async def test_peers_that_do_not_connect_take_no_more_than_their_places() -> None:
    async with running_rig(max_unconnected=2, max_peers=5, reserved_places=2) as rig:
        observer = rig.token("observer")
        waiting = [TestPeer() for _ in range(4)]
        try:
            answers = []
            for peer in waiting:
                peer.pc.createDataChannel("control")
                offer = await peer.offer()
                headers = {**observer, "Content-Type": "application/sdp"}
                answers.append(await rig.http.post("/whep", content=offer, headers=headers))
            assert [each.status_code for each in answers] == [201, 201, 429, 429]
            async with rig.peer("observer"):
                pass  # another link is not disturbed
            refused = await rig.http.post(
                "/whep", content=offer, headers={**rig.token("observer"), **headers, **observer}
            )
            assert refused.status_code == 429
        finally:
            for peer in waiting:
                await peer.close()


async def test_the_last_places_are_not_for_observers() -> None:
    async with running_rig(max_peers=2, reserved_places=1) as rig, rig.peer("observer"):
        peer = TestPeer()
        try:
            peer.pc.createDataChannel("control")
            headers = {**rig.token("observer"), "Content-Type": "application/sdp"}
            answer = await rig.http.post("/whep", content=await peer.offer(), headers=headers)
            assert (answer.status_code, answer.json()["error"]) == (503, "too_many_peers")
        finally:
            await peer.close()
        async with rig.peer("operator"):
            pass


async def test_one_link_cannot_take_all_places_and_leaves_a_supervisor_one() -> None:
    end = time.time() + 3600
    async with running_rig(max_peers=20, reserved_places=4) as rig:
        peers = rig.services.console.peers

        def taken_by(identity: Identity, places: ExitStack) -> int:
            """So many places it gets."""
            for number in range(30):
                try:
                    places.enter_context(peers.place(identity))
                except TooManyPeers:
                    return number
            return 30

        with ExitStack() as places:
            roles: list[Role] = ["observer", "observer", "operator", "operator", "supervisor"]
            got = [taken_by(Identity(role, role, f"link {number}", end), places) for number, role in enumerate(roles)]
            assert got == [12, 4, 2, 1, 1]
        assert peers.taken == 0


async def test_offers_of_one_link_are_limited() -> None:
    async with running_rig(max_offer_burst=1, max_offer_rate=0.001) as rig:
        headers = {**rig.token("observer"), "Content-Type": "application/sdp"}
        peer = TestPeer()
        try:
            peer.pc.createDataChannel("control")
            offer = await peer.offer()
            answers = [await rig.http.post("/whep", content=offer, headers=headers) for _ in range(2)]
            assert [each.status_code for each in answers] == [201, 429]
        finally:
            await peer.close()


async def test_data_that_looks_like_stun_passes_for_data() -> None:
    """An RTP packet whose sequence number is the length of a message, with an attribute that PRIORITY cannot be."""
    attribute = bytes([0x00, 0x24, 0x00, 0x02]) + bytes(4)
    lookalike = bytes([0x90, 0x60, 0x00, len(attribute)]) + bytes(16) + attribute
    async with running_rig() as rig, rig.peer("observer"):
        sctp: Any = rig.webrtc_peers[0].pc.sctp
        connection = sctp.transport.transport._connection
        came: list[Any] = []
        connection._queue.put_nowait = lambda item: came.append(item)
        protocol = connection._nominated[1].protocol
        protocol.datagram_received(lookalike, ("127.0.0.1", 9))
        assert (lookalike, 1) in came


class _Association:
    """What `guard_data` uses of aiortc's; without a socket."""

    def __init__(self) -> None:
        self.pc: Any = RTCPeerConnection(RTCConfiguration(iceServers=[]))
        self.pc.createDataChannel("x")
        self.sctp = cast(Any, self.pc.sctp)
        self.sctp._last_received_tsn = 2**32 - 10  # the numbers wrap on the way
        self.number = 2**32 - 10
        self.now = 0.0
        self.messages = 0
        self.refused: list[str] = []

        async def receive(*message: object) -> None:
            self.messages += 1

        self.sctp._receive = receive
        guard_data(self.pc, self.refused.append, lambda: self.now)

    async def sends(self, *, ordered: int | None = None, lost: bool = False, seconds: float = 0.04) -> None:
        """A message of one chunk; `ordered`: its number in the stream."""
        self.now += seconds
        self.number = (self.number + 1) % 2**32
        if lost:
            return
        chunk = DataChunk(flags=3 if ordered is not None else 7)
        chunk.tsn, chunk.stream_id, chunk.stream_seq, chunk.protocol = self.number, 1 + (ordered is None), 0, 51
        chunk.stream_seq = ordered or 0
        chunk.user_data = b"x" * 50
        await self.sctp._receive_data_chunk(chunk)


async def test_a_connection_lives_on_when_a_peer_gives_up_messages_and_says_nothing_of_it() -> None:
    peer = _Association()
    for number in range(5000):
        await peer.sends(lost=number % 100 == 50)
    assert peer.refused == []
    assert peer.messages == 4950
    assert len(peer.sctp._sack_misordered) <= MAX_GAPS / 4
    await peer.pc.close()


async def test_a_reliable_message_that_never_comes_ends_the_peer_instead_of_being_passed_over() -> None:
    peer = _Association()
    await peer.sends(ordered=0)
    await peer.sends(ordered=1, lost=True)
    await peer.sends(ordered=2)
    for _ in range(1000):
        await peer.sends()
        if peer.refused:
            break
    assert peer.refused == ["message_missing"]
    assert peer.messages < 300
    await peer.pc.close()


async def test_holes_that_come_faster_than_a_message_is_given_up_end_the_peer() -> None:
    peer = _Association()
    for number in range(MAX_GAPS + 3):
        await peer.sends(lost=number == 1, seconds=0.001)
    assert set(peer.refused) == {"too_many_gaps"}
    await peer.pc.close()


def _binding_request(username: str) -> bytes:
    message = aioice.stun.Message(
        message_method=aioice.stun.Method.BINDING,
        message_class=aioice.stun.Class.REQUEST,
        transaction_id=os.urandom(12),
    )
    message.attributes["USERNAME"] = username
    message.attributes["PRIORITY"] = 1
    message.add_message_integrity(b"wrong password")
    return bytes(message)


async def test_checks_with_false_credentials_are_not_parsed_nor_answered_and_the_peer_goes_on() -> None:
    async with running_rig() as rig, rig.peer("observer") as peer:
        assert rig.webrtc_peers[0].pc.sctp is not None
        connection: Any = rig.webrtc_peers[0].pc.sctp.transport.transport._connection
        protocol = connection._nominated[1].protocol
        assert protocol.datagram_received.__name__ == "_take_datagram", MOVED
        parsed: list[bytes] = []
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("server.peer_guards_private._datagram_received", lambda _, data, __: parsed.append(data))
            for _ in range(2000):
                protocol.datagram_received(_binding_request("evil:evil"), ("192.0.2.1", 5))
            response = bytearray(_binding_request("evil:evil"))
            response[0] = 1
            protocol.datagram_received(bytes(response), ("192.0.2.1", 5))
            protocol.datagram_received(b"\x00", ("192.0.2.1", 5))
            assert not parsed
            named = _binding_request(f"{connection.local_username}:evil")
            for _ in range(3000):
                protocol.datagram_received(named, ("192.0.2.1", 5))
            assert CHECK_BURST <= len(parsed) < 3000
        for reason, least in (("stun_unknown_user", 2000), ("stun_unasked", 1), ("stun_malformed", 1)):
            assert rig.count("lockstep_bad_input_total", where="transport", reason=reason) == least
        assert rig.count("lockstep_bad_input_total", where="transport", reason="stun_too_often") > 0
        peer.send("control", Ping(id=3))
        await peer.until(lambda each: each == Pong(id=3))


def _hello_of_a_stranger() -> bytes:
    client = SSL.Connection(SSL.Context(SSL.DTLS_METHOD))
    client.set_connect_state()
    with pytest.raises(SSL.WantReadError):
        client.do_handshake()
    return client.bio_read(1500)


ALERT = b"\x15\xfe\xfd" + bytes(8) + b"\x00\x02" + b"\x02\x28"  # RFC 6347 4.1, RFC 5246 7.2: fatal, handshake_failure


class _Overtaken(TestPeer):
    """Between the answer and its own first datagram a stranger writes to every port that the console has offered."""

    def __init__(self, said: bytes) -> None:
        super().__init__()
        self.written = 0
        self._said = said
        self._accept = self.pc.setRemoteDescription
        cast(Any, self.pc).setRemoteDescription = self._accept_late

    async def _accept_late(self, answer: RTCSessionDescription) -> None:
        ports = {int(port) for port in re.findall(r"a=candidate:\S+ 1 udp \d+ 127\.0\.0\.1 (\d+) ", answer.sdp)}
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
            stranger.bind(("127.0.0.2", 0))
            for port in ports:
                stranger.sendto(self._said, ("127.0.0.1", port))
                self.written += 1
        await self._accept(answer)


@pytest.mark.parametrize("said", [ALERT, _hello_of_a_stranger()], ids=["alert", "hello"])
async def test_who_knows_only_the_port_does_not_take_part_in_the_handshake_of_who_connects(said: bytes) -> None:
    async with running_rig() as rig:
        peer = _Overtaken(said)
        try:
            await peer.join(rig, rig.token("operator"), ("control",))
            peer.send("control", Ping(id=4))
            await peer.until(lambda each: each == Pong(id=4))
        finally:
            await peer.close()
        assert peer.written
        refused = rig.count("lockstep_bad_input_total", where="transport", reason="unknown_address")
        assert refused == peer.written


async def test_of_a_flood_from_elsewhere_little_passes_and_a_peer_whose_address_changed_is_heard() -> None:
    async with running_rig() as rig, rig.peer("observer") as peer:
        assert rig.webrtc_peers[0].pc.sctp is not None
        connection: Any = rig.webrtc_peers[0].pc.sctp.transport.transport._connection
        protocol = connection._nominated[1].protocol
        heard = protocol.datagram_received
        protocol.datagram_received = lambda data, address: heard(data, ("192.0.2.9", 7))
        peer.send("control", Ping(id=5))
        await peer.until(lambda each: each == Pong(id=5))
        del protocol.datagram_received
        passed: list[bytes] = []
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("server.peer_guards_private._datagram_received", lambda _, data, __: passed.append(data))
            for _ in range(3000):
                protocol.datagram_received(b"\x80" + bytes(40), ("192.0.2.1", 5))
        assert len(passed) < STRAY_BURST + 1000
        refused = rig.count("lockstep_bad_input_total", where="transport", reason="unknown_address")
        assert refused == 3000 - len(passed)
        peer.send("control", Ping(id=6))
        await peer.until(lambda each: each == Pong(id=6))
