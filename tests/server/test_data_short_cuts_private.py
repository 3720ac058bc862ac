"""Pins what data_short_cuts_private.py relies on, and that nothing is lost by it."""

import asyncio
import inspect
import random
import time
from collections.abc import AsyncIterator, Callable
from typing import Any

import pytest
from aiortc import RTCSctpTransport
from aiortc.rtcdtlstransport import State
from aiortc.rtcsctptransport import USERDATA_MAX_LENGTH, DataChunk, SackChunk, parse_packet, serialize_packet

from tests.server.data_ends import Ends, connected, lose, packets_of
from tests.server.rig import PATIENCE

MOVED = "aiortc moved a private part: see server/data_short_cuts_private.py"


@pytest.fixture
async def ends() -> AsyncIterator[Ends]:
    async with connected() as found:
        yield found


@pytest.mark.parametrize(
    ("caller", "call"),
    [
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
def test_aiortc_does_what_is_cut_short(caller: Callable[..., Any], call: str) -> None:
    assert call in inspect.getsource(caller), MOVED


@pytest.mark.parametrize(("length", "packets"), [(1, 1), (USERDATA_MAX_LENGTH, 1), (USERDATA_MAX_LENGTH + 1, 2)])
async def test_a_message_leaves_in_the_turn_that_it_is_sent_in(ends: Ends, length: int, packets: int) -> None:
    await ends.exchange()
    left = packets_of(ends.server.transport)
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


async def test_an_acknowledgement_travels_with_the_answer(ends: Ends) -> None:
    await ends.exchange()
    left = packets_of(ends.server.transport)
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


@pytest.mark.parametrize("jump", [3600.0, -3600.0, 20.0])
async def test_a_wall_clock_that_is_set_does_not_make_repeats_come_later(
    ends: Ends, jump: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    await ends.exchange()
    sctp: Any = ends.server.transport
    before, wall = sctp._rto, time.time
    ends.server.send("under way")
    monkeypatch.setattr(time, "time", lambda: wall() + jump)
    assert await ends.at_client.get() == "under way"
    await ends.exchange()
    assert not sctp._sent_queue
    assert sctp._rto <= before


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
