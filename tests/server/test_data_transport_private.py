"""Pins what data_transport_private.py relies on, and what it is for."""

import asyncio
import inspect
from collections.abc import AsyncIterator, Callable
from typing import Any

import pytest
from aiortc import RTCSctpTransport
from aiortc.rtcdtlstransport import RTCDtlsTransport
from aiortc.rtcsctptransport import AbortChunk, StreamResetOutgoingParam
from OpenSSL import SSL

from server.data_transport_private import (
    DRIVING_WINDOW_FLOOR,
    RETRANSMISSION_CEILING,
    RETRANSMISSION_FLOOR,
    WINDOW_FLOOR,
    tune_data_transport,
)
from server.media.aiortc_private import create_peer_connection
from tests.server.data_ends import Ends, acknowledgements_of, connected, lose, never_repeats
from tests.server.rig import PATIENCE, running_rig

MOVED = "aiortc moved a private part: see server/data_transport_private.py"
SOON = 0.8  # s; aiortc's own shortest timeout is 1 s


@pytest.fixture
async def ends() -> AsyncIterator[Ends]:
    async with connected() as found:
        yield found


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
        (RTCSctpTransport._t1_expired, "asyncio.ensure_future(self._send_chunk(self._t1_chunk))"),
        (RTCSctpTransport._t2_expired, "asyncio.ensure_future(self._send_chunk(self._t2_chunk))"),
        (
            RTCSctpTransport._reconfig_timer_expired,
            "asyncio.ensure_future(self._send_reconfig_param(self._reconfig_request))",
        ),
        (RTCSctpTransport._data_channel_close, "asyncio.ensure_future(self._transmit_reconfig())"),
        (RTCSctpTransport._send, "await self._transmit()"),
        (RTCSctpTransport._data_channel_send, "asyncio.ensure_future(self._data_channel_flush())"),
        (RTCSctpTransport._set_state, "asyncio.ensure_future(self._data_channel_flush())"),
        (RTCSctpTransport._receive_sack_chunk, "await self._data_channel_flush()"),
        (RTCSctpTransport._handle_data, "if self._sack_needed:\n            await self._send_sack()"),
        (RTCSctpTransport._send_sack, "self._sack_needed = False"),
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
        (peer,) = rig.webrtc_peers
        sctp: Any = peer.pc.sctp
        assert sctp._rto < SOON


async def test_who_drives_has_a_window_that_no_loss_makes_smaller_and_who_observes_has_not() -> None:
    async with running_rig() as rig, rig.peer("operator"), rig.peer("observer"):
        windows = dict[str, list[int]]()
        for peer in rig.webrtc_peers:
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
    never_repeats(ends.client.transport)
    for text in ("first", "second"):
        ends.client.send(text)
    await both.wait()
    dtls._write_ssl = write
    await write()
    async with asyncio.timeout(PATIENCE):
        assert [await ends.at_server.get(), await ends.at_server.get()] == ["first", "second"]


async def test_every_second_packet_is_acknowledged_and_a_single_one_after_a_while(ends: Ends) -> None:
    await ends.exchange()
    server: Any = ends.server.transport
    client: Any = ends.client.transport
    sent = acknowledgements_of(server)
    for number in range(10):
        ends.client.send(str(number))
        assert await ends.at_server.get() == str(number)
    assert 4 <= len(sent) <= 8, "a busy machine may let the time for some of them pass"
    acknowledged = asyncio.Event()
    receive = client._receive_sack_chunk

    async def heard(chunk: Any) -> None:
        await receive(chunk)
        if not client._sent_queue:
            acknowledged.set()

    client._receive_sack_chunk = heard
    never_repeats(client)
    async with asyncio.timeout(PATIENCE):
        ends.client.send("single")
        await acknowledged.wait()


async def test_who_drives_has_an_acknowledgement_for_each_packet() -> None:
    async with connected(observes=False) as ends:
        await ends.exchange()
        server: Any = ends.server.transport
        sent = acknowledgements_of(server)
        for number in range(10):
            ends.client.send(str(number))
            assert await ends.at_server.get() == str(number)
        assert len(sent) == 10


async def test_the_end_of_dtls_is_still_noticed(ends: Ends) -> None:
    closed = asyncio.Event()
    ends.server.on("close", closed.set)
    await ends.client.transport.transport.stop()
    async with asyncio.timeout(PATIENCE):
        await closed.wait()


async def test_a_lost_message_is_repeated_soon(ends: Ends) -> None:
    await ends.exchange()
    sctp: Any = ends.server.transport
    lost = lose(sctp, 1)
    assert sctp._rto < SOON
    async with asyncio.timeout(PATIENCE):
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


async def test_on_a_path_of_more_than_a_second_and_a_half_nothing_is_repeated_before_its_answer(ends: Ends) -> None:
    sctp: Any = ends.server.transport
    for _ in range(8):
        sctp._update_rto(1.8)
    assert 1.8 < sctp._rto <= 3.6


async def test_a_timeout_does_not_shut_the_window(ends: Ends) -> None:
    await ends.exchange()
    sctp: Any = ends.server.transport
    sctp._t3_cancel()
    sctp._t3_expired()
    assert sctp._cwnd >= WINDOW_FLOOR


async def test_many_lost_messages_are_all_repeated_by_one_timeout(ends: Ends) -> None:
    await ends.exchange()
    texts = [str(number) * 1000 for number in range(4)]
    sctp: Any = ends.server.transport
    lost = lose(sctp, len(texts))
    assert sctp._rto < SOON
    async with asyncio.timeout(PATIENCE):
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


@pytest.mark.parametrize("timer", ["_t1_expired", "_t2_expired", "_t3_expired", "_reconfig_timer_expired"])
async def test_a_timer_while_the_connection_says_goodbye_raises_nothing(
    ends: Ends, timer: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    await ends.exchange()
    sctp: Any = ends.server.transport
    lose(sctp, 1)
    ends.server.send("never arrives")
    sctp._t1_chunk = sctp._t2_chunk = AbortChunk()
    sctp._reconfig_request = StreamResetOutgoingParam(1, 1, 1, [1])
    sctp._t3_cancel()

    async def refuse(data: bytes) -> None:
        raise SSL.Error([("SSL routines", "", "protocol is shutdown")])

    with monkeypatch.context() as ending:  # as after `SSL.Connection.shutdown` in `RTCDtlsTransport.stop`
        ending.setattr(sctp.transport, "_send_data", refuse)
        before = asyncio.all_tasks()
        getattr(sctp, timer)()
        (sending,) = asyncio.all_tasks() - before
        await asyncio.wait([sending])
        assert sending.exception() is None
    for cancel in (sctp._t1_cancel, sctp._t2_cancel, sctp._t3_cancel, sctp._reconfig_timer_cancel):
        cancel()


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
    assert waits == pytest.approx([0.5, 1.0, 2.0, 3.0, 3.0], abs=0.3)
