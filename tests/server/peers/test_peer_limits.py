"""What peers may take, ask and say, and what comes of more: over real connections."""

import asyncio
import os
import re
import socket
import time
from contextlib import ExitStack
from typing import Any, cast

import aioice.stun
import pytest
from aiortc import RTCSessionDescription
from aiortc.rtcsctptransport import DataChunk
from OpenSSL import SSL

from lockstep.protocol.console import Role
from lockstep.protocol.messages import Ping, Pong, StopTaken
from lockstep.server.auth.tokens import Identity
from lockstep.server.errors import TooManyPeers
from tests.server.rig import PATIENCE, Rig, TestPeer, eventually, running_rig

LARGEST_MESSAGE = 64 * 1024  # bytes, that a peer may send


def _dropped(rig: Rig, reason: str) -> int:
    """Datagrams that came to the console's port and went no further."""
    return rig.dependencies.context.endpoint.dropped[reason]


async def test_a_message_that_never_ends_is_not_kept() -> None:
    async with running_rig() as rig, rig.peer("observer") as peer:
        sctp: Any = peer.pc.sctp
        for number in range(LARGEST_MESSAGE // 1000 + 2):
            chunk = DataChunk(flags=2 if number == 0 else 0)  # it begins, and goes on
            chunk.tsn, chunk.stream_id, chunk.stream_seq, chunk.protocol = sctp._local_tsn, 1, 9, 51
            chunk.user_data = b"x" * 1000
            sctp._local_tsn = (sctp._local_tsn + 1) % 2**32
            await sctp._send_chunk(chunk)
            await asyncio.sleep(0)
        async with asyncio.timeout(PATIENCE):
            await rig.dependencies.console.peers.all_gone()
        assert rig.count("lockstep_bad_input_total", where="transport", reason="message_too_large") == 1
        assert rig.count("lockstep_peers_ended_total", why="too much") == 1
        assert rig.count("lockstep_internal_errors_total", where="peer") == 0


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
        await eventually(lambda: rig.dependencies.console.clock.stop.stopped)
        assert rig.count("lockstep_bad_input_total", where="control", reason="flood") >= 15


async def test_a_malformed_stop_is_counted_and_stops_all_the_same_and_its_sender_hears_of_it_by_its_id() -> None:
    async with running_rig() as rig, rig.peer("observer") as peer:
        peer.send_raw("stop", '{"type":"stop","reason":5,"press":"my stop"}')
        taken = await peer.until(lambda each: isinstance(each, StopTaken))
        assert isinstance(taken, StopTaken)
        assert taken.press == "my stop"
        await eventually(lambda: rig.dependencies.console.clock.stop.stopped)
        stop = rig.dependencies.console.clock.stop
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
            await eventually(lambda: len(rig.webrtc_peers) == 2)  # its place is free again
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
        peers = rig.dependencies.console.peers

        def taken_by(identity: Identity, places: ExitStack) -> int:
            """So many places it gets."""
            for number in range(30):
                try:
                    places.enter_context(peers.places.keep(identity))
                except TooManyPeers:
                    return number
            return 30

        with ExitStack() as places:
            roles: list[Role] = ["observer", "observer", "operator", "operator", "supervisor"]
            got = [taken_by(Identity(role, role, f"link {number}", end), places) for number, role in enumerate(roles)]
            assert got == [12, 4, 2, 1, 1]
        assert peers.places.taken == 0


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
        assert _dropped(rig, "unknown_source") >= peer.written


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


async def test_checks_with_false_credentials_are_not_answered_and_the_peer_goes_on() -> None:
    async with running_rig(ice_hosts=("127.0.0.1",)) as rig, rig.peer("observer") as peer:
        (port,) = {int(found) for found in re.findall(r" 127\.0\.0\.1 (\d+) typ host", peer.pc.remoteDescription.sdp)}
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
            stranger.bind(("127.0.0.2", 0))
            stranger.setblocking(False)
            for number in range(1000):
                stranger.sendto(_binding_request("evil:evil"), ("127.0.0.1", port))
                if number % 50 == 0:
                    await asyncio.sleep(0)
            stranger.sendto(b"\x00", ("127.0.0.1", port))
            peer.send("control", Ping(id=3))
            await peer.until(lambda each: each == Pong(id=3))
            with pytest.raises(BlockingIOError):
                stranger.recv(100)
        assert rig.dependencies.context.endpoint.dropped.total() >= 1001
