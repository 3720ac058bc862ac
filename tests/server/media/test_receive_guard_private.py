"""Pins what receive_guard_private.py relies on, and what it is for."""

import asyncio
import inspect
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any, cast

import pytest
from aiortc import RTCConfiguration, RTCDataChannel, RTCPeerConnection, RTCSessionDescription
from aiortc.rtcdtlstransport import RTCDtlsTransport, State
from aiortc.rtp import RtcpRrPacket

from server.loop_turns import HasFileno, LoopTurns
from server.media.aiortc_private import create_peer_connection
from server.media.receive_guard_private import HANDSHAKE_DONE, MAX_SOURCES, _Intake, guard_transports
from server.media.receive_turns import ReceiveTurns
from tests.server.rig import PATIENCE

MOVED = "aiortc moved a private part: see server/media/receive_guard_private.py"


class Ends:
    """The client's channel; the server's connection, and what is counted there."""

    def __init__(self, client: RTCDataChannel, server: RTCPeerConnection, errors: list[str]) -> None:
        self.client = client
        self.server = server
        self.errors = errors
        self.came: asyncio.Queue[str] = asyncio.Queue(100)

    @property
    def dtls(self) -> Any:
        assert self.server.sctp is not None
        return self.server.sctp.transport

    @property
    def intake(self) -> Any:
        return self.dtls.transport._connection._queue


@asynccontextmanager
async def connected(
    turns: ReceiveTurns | None = None,
    on_socket: Callable[[HasFileno], None] | None = None,
    at_once: Callable[[], bool] | None = None,
) -> AsyncIterator[Ends]:
    client, server = RTCPeerConnection(RTCConfiguration(iceServers=[])), create_peer_connection()
    opened = asyncio.Event()
    errors: list[str] = []
    channel = client.createDataChannel("any")
    channel.on("open", opened.set)
    ends = Ends(channel, server, errors)
    server.on("datachannel", lambda there: there.on("message", ends.came.put_nowait))
    try:
        async with asyncio.timeout(PATIENCE):
            await client.setLocalDescription(await client.createOffer())
            await server.setRemoteDescription(RTCSessionDescription(client.localDescription.sdp, "offer"))
            guard_transports(server, errors.append, turns, on_socket, at_once)
            await server.setLocalDescription(await server.createAnswer())
            await client.setRemoteDescription(RTCSessionDescription(server.localDescription.sdp, "answer"))
            await opened.wait()
            yield ends
    finally:
        await server.close()
        await client.close()


async def exchanged(ends: Ends, text: str) -> None:
    ends.client.send(text)
    assert await ends.came.get() == text


def test_what_is_done_with_a_datagram_is_as_expected() -> None:
    source = inspect.getsource(RTCDtlsTransport._recv_next)
    for expected in (
        "if not self.__handshake_done:",
        "if first_byte > 19 and first_byte < 64:",
        "self._ssl.bio_write(data)",
        "data = self._ssl.recv(1500)",
        "except SSL.ZeroReturnError:",
        "await self._write_ssl()",
        "await self._data_receiver._handle_data(data)",
        "elif first_byte > 127 and first_byte < 192 and self._rx_srtp:",
        "data = self._rx_srtp.unprotect_rtcp(data)",
        "await self._handle_rtcp_data(data)",
        "except pylibsrtp.Error as exc:",
    ):
        assert expected in source, MOVED
    run: Any = RTCDtlsTransport.__dict__["_RTCDtlsTransport__run"]
    assert "except ConnectionError:" in inspect.getsource(run), MOVED


def test_before_the_connection_is_up_the_queue_is_bounded_and_still_ends() -> None:
    errors: list[str] = []
    queue = _Intake(None, errors.append, None)
    for _ in range(3000):
        queue.put_nowait((b"data", 1))
    queue.put_nowait((b"", 1))
    queue.put_nowait((bytes(1501), 1))
    queue.put_nowait(None)
    assert queue.qsize() == 1025
    assert errors == ["receive_overflow"] * (3000 - 1024) + ["datagram_size"] * 2


async def test_what_need_not_wait_is_handled_at_once_unless_something_before_it_waits() -> None:
    clock = [0.0]
    turns = LoopTurns(lambda: clock[0])
    urgent = [True]
    async with connected(ReceiveTurns(turns), at_once=lambda: urgent[0]) as ends:
        await exchanged(ends, "first")
        handled: list[bytes] = []
        intake = ends.intake

        def handle(data: bytes) -> bool:
            handled.append(data)
            return True

        intake._handled = handle
        intake.put_nowait((b"a", 1))
        assert handled == [b"a"]
        urgent[0] = False
        intake.put_nowait((b"b", 1))
        urgent[0] = True
        intake.put_nowait((b"c", 1))
        assert handled == [b"a"], "b waits for its turn, and c for b"
        async with asyncio.timeout(PATIENCE):
            while len(handled) < 3:  # noqa: ASYNC110
                await asyncio.sleep(0)
        assert handled == [b"a", b"b", b"c"]
        intake.put_nowait((b"d", 1))
        assert handled[-1] == b"d"


async def test_a_message_is_handled_in_the_turn_that_its_datagram_comes_in(monkeypatch: pytest.MonkeyPatch) -> None:
    async with connected() as ends:
        await exchanged(ends, "first")
        handled: list[bool] = []
        take = ends.intake.put_nowait

        def put(item: Any) -> None:
            before = ends.came.qsize()
            take(item)
            handled.append(ends.came.qsize() > before and ends.intake.empty())

        monkeypatch.setattr(ends.intake, "put_nowait", put)
        for number in range(5):
            await exchanged(ends, str(number))
        assert handled.count(True) == 5
        assert ends.errors == []


async def test_an_observers_message_is_handled_in_its_turn(monkeypatch: pytest.MonkeyPatch) -> None:
    async with connected(ReceiveTurns(LoopTurns())) as ends:
        await exchanged(ends, "first")
        handled: list[bool] = []
        take = ends.intake.put_nowait

        def put(item: Any) -> None:
            before = ends.came.qsize()
            take(item)
            handled.append(ends.came.qsize() > before)

        monkeypatch.setattr(ends.intake, "put_nowait", put)
        for number in range(5):
            await exchanged(ends, str(number))
        assert len(handled) >= 5
        assert not any(handled)


async def test_the_socket_that_datagrams_come_by_is_told_once() -> None:
    told: list[HasFileno] = []
    async with connected(on_socket=told.append) as ends:
        for text in ("first", "second"):
            await exchanged(ends, text)
        pair = ends.dtls.transport._connection._nominated[1]
        assert [each.fileno() for each in told] == [pair.protocol.transport.get_extra_info("socket").fileno()]


async def test_what_waits_for_its_turn_is_bounded_and_forgotten_at_the_end() -> None:
    async with connected(ReceiveTurns(LoopTurns())) as ends:
        await exchanged(ends, "first")
        intake = ends.intake
        for _ in range(2000):
            intake.put_nowait((bytes([23]) + bytes(40), 1))
        assert ends.errors == ["receive_overflow"] * (2000 - 1024)
        ends.dtls._set_state(State.CLOSED)
        while intake.handle_next():
            pass
        assert set(ends.errors) == {"receive_overflow"}


async def test_what_is_not_from_the_peer_is_ignored_and_the_connection_goes_on() -> None:
    async with connected() as ends:
        await exchanged(ends, "before")
        for first in (0, 22, 23, 63, 64, 100, 128, 144, 191, 192, 255):
            ends.intake.put_nowait((bytes([first, 200]) + bytes(40), 1))
            ends.intake.put_nowait((bytes([first]), 1))
        ends.intake.put_nowait((b"", 1))
        await exchanged(ends, "after")
        assert ends.errors == ["datagram_size"]


async def test_a_message_that_cannot_be_handled_is_counted_and_the_connection_goes_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async with connected() as ends:
        await exchanged(ends, "before")
        sctp: Any = ends.server.sctp
        failed = asyncio.Event()

        async def fail(data: bytes) -> None:
            failed.set()
            raise IndexError(data)

        with monkeypatch.context() as patch:
            patch.setattr(sctp, "_handle_data", fail)
            ends.client.send("lost, and sent again")
            await failed.wait()
        assert set(ends.errors) == {"malformed"}
        assert await ends.came.get() == "lost, and sent again"
        await exchanged(ends, "after")


async def test_a_peer_has_only_so_many_sources_and_goes_on_with_those_it_has() -> None:
    handled: list[bytes] = []

    async def take(data: bytes, *more: Any) -> None:
        handled.append(data)

    async with connected() as ends:
        await exchanged(ends, "before")
        ends.dtls._handle_rtcp_data, protect = take, cast(Any, ends.client.transport.transport)._tx_srtp.protect_rtcp
        ends.intake.put_nowait((bytes((128, 200, 0, 1)) + bytes(30), 1))  # forged: it takes no place
        for source in range(1, 2 * MAX_SOURCES + 1):
            ends.intake.put_nowait((protect(bytes(RtcpRrPacket(ssrc=source))), 1))
        assert len(handled) == MAX_SOURCES
        assert ends.errors == ["too_many_sources"] * MAX_SOURCES
        ends.intake.put_nowait((protect(bytes(RtcpRrPacket(ssrc=1))), 1))
        assert len(handled) == MAX_SOURCES + 1
        await exchanged(ends, "after")


async def test_the_peers_goodbye_ends_the_connection() -> None:
    async with connected() as ends:
        assert getattr(ends.dtls, HANDSHAKE_DONE), MOVED
        closed = asyncio.Event()
        ends.dtls.on("statechange", lambda: closed.set() if ends.dtls.state == "closed" else None)
        client: Any = ends.client.transport
        await client.transport.stop()
        await closed.wait()
        assert ends.errors == []


async def test_what_estimates_a_path_that_no_picture_comes_from_is_left_out() -> None:
    offering, answering = RTCPeerConnection(), create_peer_connection()
    try:
        offering.addTransceiver("video", direction="recvonly")
        await answering.setRemoteDescription(RTCSessionDescription((await offering.createOffer()).sdp, "offer"))
        [transceiver] = answering.getTransceivers()
        receiver: Any = transceiver.receiver
        assert receiver._RTCRtpReceiver__remote_bitrate_estimator is not None, MOVED
        guard_transports(answering, lambda name: None)
        assert receiver._RTCRtpReceiver__remote_bitrate_estimator is None
    finally:
        await offering.close()
        await answering.close()
