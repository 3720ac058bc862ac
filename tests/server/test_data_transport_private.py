"""Pins what data_transport_private.py relies on, and what it is for."""

import asyncio
import inspect
import random
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any

import pytest
from aiortc import RTCConfiguration, RTCDataChannel, RTCPeerConnection, RTCSctpTransport, RTCSessionDescription
from aiortc.rtcdtlstransport import RTCDtlsTransport, State
from aiortc.rtcsctptransport import USERDATA_MAX_LENGTH, DataChunk, SackChunk, parse_packet, serialize_packet

from server.data_transport_private import (
    DRIVING_WINDOW_FLOOR,
    RETRANSMISSION_CEILING,
    RETRANSMISSION_FLOOR,
    WINDOW_FLOOR,
    tune_data_transport,
)
from server.media.aiortc_private import create_peer_connection
from tests.server.rig import PATIENCE, running_rig

MOVED = "aiortc moved a private part: see server/data_transport_private.py"
SOON = 0.8  # s; aiortc's own shortest timeout is 1 s


class Ends:
    """Two ends of a reliable channel: a plain client's and the server's."""

    def __init__(self, client: RTCDataChannel, server: RTCDataChannel) -> None:
        self.client = client
        self.server = server
        self.at_client: asyncio.Queue[str] = asyncio.Queue(100)
        self.at_server: asyncio.Queue[str] = asyncio.Queue(100)
        client.on("message", self.at_client.put_nowait)
        server.on("message", self.at_server.put_nowait)

    async def exchange(self) -> None:
        """One message each way, so that both have measured a round trip."""
        self.server.send("there")
        assert await self.at_client.get() == "there"
        self.client.send("back")
        assert await self.at_server.get() == "back"


@pytest.fixture
async def ends() -> AsyncIterator[Ends]:
    async with connected() as found:
        yield found


@asynccontextmanager
async def connected(*, observes: bool = True) -> AsyncIterator[Ends]:
    """The server's side is tuned, the client's is plain aiortc. Sections are bundled, as browsers do."""
    client, server = RTCPeerConnection(RTCConfiguration(iceServers=[])), create_peer_connection()
    there: asyncio.Future[RTCDataChannel] = asyncio.get_running_loop().create_future()
    server.on("datachannel", there.set_result)
    opened = asyncio.Event()
    client.addTransceiver("video", direction="recvonly")
    here = client.createDataChannel("session")
    here.on("open", opened.set)
    try:
        async with asyncio.timeout(PATIENCE):
            await client.setLocalDescription(await client.createOffer())
            await server.setRemoteDescription(RTCSessionDescription(client.localDescription.sdp, "offer"))
            tune_data_transport(server, observes=observes)
            await server.setLocalDescription(await server.createAnswer())
            await client.setRemoteDescription(RTCSessionDescription(server.localDescription.sdp, "answer"))
            await opened.wait()
            yield Ends(here, await there)
    finally:
        await server.close()
        await client.close()


def lose(sctp: Any, first: int) -> list[bytes]:
    """Lose the first so many data packets that `sctp` sends; the list has what was lost."""
    lost: list[bytes] = []
    dtls = sctp.transport
    send = dtls._send_data

    async def send_or_lose(data: bytes) -> None:
        if len(lost) < first and any(isinstance(chunk, DataChunk) for chunk in parse_packet(data)[3]):
            lost.append(data)
        else:
            await send(data)

    dtls._send_data = send_or_lose
    return lost


@pytest.mark.parametrize("name", ["_rto", "_cwnd", "_srtt", "_rttvar", "_t1_handle", "_t3_handle"])
async def test_sctp_has(name: str) -> None:
    pc = create_peer_connection()
    pc.createDataChannel("any")
    assert hasattr(pc.sctp, name), MOVED
    await pc.close()


@pytest.mark.parametrize(
    ("caller", "call"),
    [
        (RTCDtlsTransport._recv_next, "await self._data_receiver._handle_data(data)"),
        (RTCDtlsTransport._recv_next, "self._ssl.recv(1500)"),
        (RTCSctpTransport.start, "_register_data_receiver(self)"),
        (RTCSctpTransport._receive_sack_chunk, "self._update_rto("),
        (RTCSctpTransport._t1_start, "call_later(self._rto, self._t1_expired)"),
        (RTCSctpTransport._t3_start, "call_later(self._rto, self._t3_expired)"),
        (RTCSctpTransport._t3_restart, "call_later(self._rto, self._t3_expired)"),
        (RTCSctpTransport._t3_expired, "asyncio.ensure_future(self._transmit())"),
        (RTCSctpTransport._send, "await self._transmit()"),
        (RTCSctpTransport._data_channel_send, "asyncio.ensure_future(self._data_channel_flush())"),
        (RTCSctpTransport._set_state, "asyncio.ensure_future(self._data_channel_flush())"),
        (RTCSctpTransport._receive_sack_chunk, "await self._data_channel_flush()"),
        (RTCSctpTransport._handle_data, "if self._sack_needed:\n            await self._send_sack()"),
        (RTCSctpTransport._send_sack, "self._sack_needed = False"),
        # what the short cuts do in their place
        (RTCSctpTransport._send, "self._local_tsn = tsn_plus_one(self._local_tsn)"),
        (RTCSctpTransport._send, "self._outbound_stream_seq[stream_id] = uint16_add(stream_seq, 1)"),
        (RTCSctpTransport._send, "chunk._sent_time = None\n\n            pos"),
        (RTCSctpTransport._transmit, "chunk._sent_time = time.time()\n\n            await self._send_chunk(chunk)"),
        (RTCSctpTransport._receive_sack_chunk, "cwnd_fully_utilized = self._flight_size >= self._cwnd"),
        (RTCSctpTransport._receive_sack_chunk, "if uint32_gt(self._last_sacked_tsn, chunk.cumulative_tsn):"),
        (RTCSctpTransport._receive_sack_chunk, "if done == 1 and schunk._sent_count == 1:"),
        (RTCSctpTransport._update_advanced_peer_ack_point, "self._advanced_peer_ack_tsn = self._last_sacked_tsn"),
    ],
)
def test_aiortc_calls_what_is_replaced(caller: Callable[..., Any], call: str) -> None:
    assert call in inspect.getsource(caller), MOVED


async def test_a_peer_without_data_channels_is_left_alone() -> None:
    pc = create_peer_connection()
    tune_data_transport(pc)
    assert pc.sctp is None
    await pc.close()


async def test_the_console_tunes_its_connections() -> None:
    async with running_rig() as rig, rig.peer("observer"):
        (peer,) = rig.services.console.peers
        sctp: Any = peer.pc.sctp
        assert sctp._rto < SOON


async def test_who_drives_has_a_window_that_no_loss_makes_smaller_and_who_observes_has_not() -> None:
    async with running_rig() as rig, rig.peer("operator"), rig.peer("observer"):
        windows = dict[str, list[int]]()
        for peer in rig.services.console.peers:
            sctp: Any = peer.pc.sctp
            windows[peer.role] = [sctp._cwnd]
            sctp._t3_cancel()
            sctp._t3_expired()
            windows[peer.role].append(sctp._cwnd)
        assert all(window >= DRIVING_WINDOW_FLOOR for window in windows["operator"])
        assert all(window < DRIVING_WINDOW_FLOOR for window in windows["observer"])
        assert windows["observer"][1] >= WINDOW_FLOOR


async def test_every_record_that_waits_is_delivered_at_once(ends: Ends) -> None:
    dtls: Any = ends.client.transport.transport
    write, written, both = dtls._write_ssl, [], asyncio.Event()

    async def hold() -> None:
        written.append(1)
        if len(written) == 2:
            both.set()

    await ends.exchange()
    dtls._write_ssl = hold
    for text in ("first", "second"):
        ends.client.send(text)
    await both.wait()
    dtls._write_ssl = write
    await write()
    async with asyncio.timeout(SOON):  # sooner than the client would repeat the second
        assert [await ends.at_server.get(), await ends.at_server.get()] == ["first", "second"]


@pytest.mark.parametrize(("length", "packets"), [(1, 1), (USERDATA_MAX_LENGTH, 1), (USERDATA_MAX_LENGTH + 1, 2)])
async def test_a_message_leaves_in_the_turn_that_it_is_sent_in(
    ends: Ends, monkeypatch: pytest.MonkeyPatch, length: int, packets: int
) -> None:
    await ends.exchange()
    left: list[bytes] = []
    dtls: Any = ends.server.transport.transport
    send = dtls._send_data

    async def watch(data: bytes) -> None:
        left.append(data)
        await send(data)

    monkeypatch.setattr(dtls, "_send_data", watch)
    text = "n" * length
    ends.server.send(text)
    assert len(left) == packets
    assert ends.server.bufferedAmount == 0
    assert await ends.at_client.get() == text


async def test_what_a_listener_sends_in_answer_leaves_in_order(ends: Ends) -> None:
    rest = [str(number) for number in range(1000)]

    def more() -> None:
        if rest and ends.server.bufferedAmount == 0:
            ends.server.send(rest.pop(0))

    await ends.exchange()
    ends.server.on("bufferedamountlow", more)
    async with asyncio.timeout(PATIENCE):
        ends.server.send("begin")
        assert [await ends.at_client.get() for _ in range(1001)] == ["begin", *map(str, range(1000))]


async def test_every_second_packet_is_acknowledged_and_a_single_one_after_a_while(ends: Ends) -> None:
    await ends.exchange()
    server: Any = ends.server.transport
    client: Any = ends.client.transport
    sent: list[int] = []
    send = server._send_chunk

    async def watch(chunk: Any) -> None:
        if isinstance(chunk, SackChunk):
            sent.append(chunk.cumulative_tsn)
        await send(chunk)

    server._send_chunk = watch
    for number in range(10):
        ends.client.send(str(number))
        assert await ends.at_server.get() == str(number)
    assert 4 <= len(sent) <= 6
    acknowledged = asyncio.Event()
    receive = client._receive_sack_chunk

    async def heard(chunk: Any) -> None:
        await receive(chunk)
        if not client._sent_queue:
            acknowledged.set()

    client._receive_sack_chunk = heard
    async with asyncio.timeout(SOON):
        ends.client.send("single")
        await acknowledged.wait()


async def test_who_drives_has_an_acknowledgement_for_each_packet() -> None:
    async with connected(observes=False) as ends:
        await ends.exchange()
        server: Any = ends.server.transport
        sent: list[int] = []
        send = server._send_chunk

        async def watch(chunk: Any) -> None:
            if isinstance(chunk, SackChunk):
                sent.append(chunk.cumulative_tsn)
            await send(chunk)

        server._send_chunk = watch
        for number in range(10):
            ends.client.send(str(number))
            assert await ends.at_server.get() == str(number)
        assert len(sent) == 10


async def test_an_acknowledgement_travels_with_the_answer(ends: Ends) -> None:
    await ends.exchange()
    left: list[bytes] = []
    dtls: Any = ends.server.transport.transport
    send = dtls._send_data

    async def watch(data: bytes) -> None:
        left.append(data)
        await send(data)

    dtls._send_data = watch
    ends.server.on("message", lambda text: ends.server.send(f"answer to {text}"))
    for number in range(5):
        ends.client.send(str(number))
        assert await ends.at_client.get() == f"answer to {number}"
    client: Any = ends.client.transport
    assert not client._sent_queue
    chunks = [type(chunk) for data in left for chunk in parse_packet(data)[3]]
    assert chunks == [SackChunk, DataChunk] * 5


async def test_everything_arrives_once_and_in_order_whatever_is_lost(ends: Ends) -> None:
    await ends.exchange()
    chance = random.Random(5)

    def lossy(dtls: Any) -> None:
        send = dtls._send_data

        async def send_or_not(data: bytes) -> None:
            if chance.random() > 0.2:
                await send(data)

        dtls._send_data = send_or_not

    lossy(ends.server.transport.transport)
    lossy(ends.client.transport.transport)
    expected = [f"{number} {'x' * chance.choice((0, 10, 3000))}" for number in range(60)]
    async with asyncio.timeout(PATIENCE):
        for text in expected:
            ends.server.send(text)
        assert [await ends.at_client.get() for _ in expected] == expected


async def test_an_acknowledgement_that_is_not_the_peers_is_not_believed(ends: Ends) -> None:
    await ends.exchange()
    sctp: Any = ends.server.transport
    lose(sctp, 1000)
    ends.server.send("unacknowledged")
    (waiting,) = sctp._sent_queue
    sack = SackChunk()
    sack.cumulative_tsn = waiting.tsn
    genuine = serialize_packet(5000, 5000, sctp._local_verification_tag, sack)
    other_tag = serialize_packet(5000, 5000, sctp._local_verification_tag ^ 1, sack)
    damaged = genuine[:-1] + bytes([genuine[-1] ^ 1])
    for packet in (other_tag, damaged):
        await sctp._handle_data(packet)
        assert list(sctp._sent_queue) == [waiting]
    await sctp._handle_data(genuine)
    assert not sctp._sent_queue
    assert sctp._flight_size == 0


async def test_what_is_sent_after_the_end_raises_nothing(ends: Ends) -> None:
    await ends.exchange()
    sctp: Any = ends.server.transport
    await sctp.transport.stop()
    sctp.transport._set_state(State.CLOSED)
    ends.server.send("to nobody")
    sctp._t3_cancel()


async def test_the_end_of_dtls_is_still_noticed(ends: Ends) -> None:
    closed = asyncio.Event()
    ends.server.on("close", closed.set)
    await ends.client.transport.transport.stop()
    async with asyncio.timeout(PATIENCE):
        await closed.wait()


async def test_a_lost_message_is_repeated_soon(ends: Ends) -> None:
    await ends.exchange()
    lost = lose(ends.server.transport, 1)
    async with asyncio.timeout(SOON):
        ends.server.send("once")
        assert await ends.at_client.get() == "once"
    assert len(lost) == 1


async def test_the_timeout_stays_above_a_delayed_acknowledgement(ends: Ends) -> None:
    await ends.exchange()
    sctp: Any = ends.server.transport
    assert RETRANSMISSION_FLOOR <= sctp._rto < SOON
    sctp._update_rto(2.0)
    assert sctp._rto > SOON


async def test_what_an_outage_held_for_ten_seconds_does_not_lengthen_the_wait_to_that(ends: Ends) -> None:
    await ends.exchange()
    sctp: Any = ends.server.transport
    for held in (10.0, 8.0, 5.0):
        sctp._update_rto(held)
    assert sctp._rto == RETRANSMISSION_CEILING


async def test_a_timeout_does_not_shut_the_window(ends: Ends) -> None:
    await ends.exchange()
    sctp: Any = ends.server.transport
    sctp._t3_cancel()
    sctp._t3_expired()
    assert sctp._cwnd >= WINDOW_FLOOR


async def test_many_lost_messages_are_all_repeated_by_one_timeout(ends: Ends) -> None:
    await ends.exchange()
    texts = [str(number) * 1000 for number in range(4)]
    lost = lose(ends.server.transport, len(texts))
    async with asyncio.timeout(SOON):
        for text in texts:
            ends.server.send(text)
        assert [await ends.at_client.get() for _ in texts] == texts
    assert len(lost) == len(texts)


async def test_a_timer_after_the_end_of_the_connection_raises_nothing(ends: Ends) -> None:
    await ends.exchange()
    unhandled: list[dict[str, Any]] = []
    asyncio.get_running_loop().set_exception_handler(lambda loop, context: unhandled.append(context))
    sctp: Any = ends.server.transport
    lose(sctp, 1)
    ends.server.send("never arrives")
    await ends.server.transport._data_channel_flush()
    await sctp.transport.stop()
    sctp._t3_cancel()
    before = asyncio.all_tasks()
    sctp._t3_expired()
    (repeat,) = asyncio.all_tasks() - before
    await asyncio.wait([repeat])
    assert repeat.exception() is None
    assert unhandled == []


async def test_while_connecting_the_wait_grows() -> None:
    pc = create_peer_connection()
    pc.createDataChannel("any")
    tune_data_transport(pc)
    sctp: Any = pc.sctp
    waits = []

    async def vanish(chunk: object) -> None:
        """Nobody answers."""

    sctp._send_chunk = vanish
    await sctp._init()
    for _ in range(5):
        waits.append(sctp._t1_handle.when() - asyncio.get_running_loop().time())
        sctp._t1_handle.cancel()
        sctp._t1_expired()
    await pc.close()
    assert waits == pytest.approx([0.5, 1.0, 2.0, 3.0, 3.0], abs=0.1)
