"""ICE over TCP: a whole session of it, what strangers may cost, and what a peer that does not read loses."""

import asyncio
import contextlib
import socket
from collections.abc import AsyncIterator, Callable, Iterable
from contextlib import asynccontextmanager

import pytest

from lockstep.bench.harness.free_port import free_port
from lockstep.rtc.addresses import Datagram, Path
from lockstep.rtc.channels import ChannelMessage, ChannelOpened
from lockstep.rtc.endpoint import Connection, Endpoint, EndpointSettings
from lockstep.rtc.ice.tcp import TcpFraming, frame
from lockstep.rtc.peer_events import Connected, PeerEnded, PeerEvent
from lockstep.rtc.sdp import SessionDescription, parse_description, write_description
from lockstep.rtc.sockets.tcp_port import EMPTY_BURST, STRANGER_DATAGRAMS, TcpPort, TcpPortSettings
from tests.waiting import PATIENCE

HOST = "127.0.0.1"


async def until(connection: Connection, wanted: type[PeerEvent]) -> PeerEvent:
    async with asyncio.timeout(PATIENCE):
        async for event in connection:
            if isinstance(event, wanted):
                return event
            assert not isinstance(event, PeerEnded), event
    raise AssertionError("ended")


class Adapter(asyncio.DatagramProtocol):
    """Stands for the side that connects: a UDP socket before a TCP connection to `server`."""

    def __init__(self, server: tuple[str, int]) -> None:
        self._server = server
        self._writer: asyncio.StreamWriter | None = None
        self._peer: tuple[str, int] | None = None
        self._tasks: list[asyncio.Task[None]] = []

    async def open(self) -> int:
        """The port of the UDP socket."""
        reader, self._writer = await asyncio.open_connection(*self._server)
        self._transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(lambda: self, (HOST, 0))
        self._tasks.append(asyncio.create_task(self._read(reader)))
        return int(self._transport.get_extra_info("sockname")[1])

    def datagram_received(self, data: bytes, address: tuple[str, int]) -> None:
        self._peer = address
        if self._writer is not None and not self._writer.is_closing():
            self._writer.write(frame(data))

    async def _read(self, reader: asyncio.StreamReader) -> None:
        framing = TcpFraming()
        while data := await reader.read(65536):
            for each in framing.receive_bytes(data):
                self._transport.sendto(each, self._peer)

    def cut(self) -> None:
        """The connection ends as with the process that has it."""
        if self._writer is not None:
            self._writer.transport.abort()

    async def close(self) -> None:
        self.cut()
        self._transport.close()
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)


@asynccontextmanager
async def over_tcp(settings: EndpointSettings | None = None) -> AsyncIterator[tuple[Connection, Connection, Adapter]]:
    """A session with an endpoint that is reached by TCP alone: its connection, the other one, what is between."""
    async with Endpoint([HOST], tcp=True, settings=settings) as ours, Endpoint([HOST]) as theirs:
        offerer, answerer = theirs.connect(controlling=True), ours.connect(controlling=False)
        answer = write_description(answerer.answer(without_candidates(offerer.offer()), {}))
        [(host, number)] = {each.base for each in ours.candidates if each.candidate.transport == "tcp"}
        adapter = Adapter((host, number))
        port = await adapter.open()
        try:
            lines = [line for line in answer.splitlines() if not line.startswith("a=candidate")]
            offerer.accept(
                parse_description("\r\n".join([*lines, f"a=candidate:1 1 udp 1 {HOST} {port} typ host", ""]))
            )
            yield answerer, offerer, adapter
        finally:
            await adapter.close()


def without_candidates(offer: SessionDescription) -> SessionDescription:
    lines = write_description(offer).splitlines()
    return parse_description("\r\n".join([each for each in lines if not each.startswith("a=candidate")] + [""]))


async def test_a_session_lives_on_one_tcp_connection_and_ends_with_a_goodbye() -> None:
    async with over_tcp() as (ours, theirs, _):
        await until(ours, Connected)
        assert ours.peer.ice.path is not None
        assert ours.peer.ice.path.transport == "tcp"
        channel = theirs.open_channel("x")
        await until(theirs, ChannelOpened)
        theirs.send(channel, "y" * 10_000)
        assert await until(ours, ChannelMessage) == ChannelMessage(channel, "y" * 10_000)
        ours.send(channel, "z")
        assert await until(theirs, ChannelMessage) == ChannelMessage(channel, "z")
        ours.close()
        assert [event async for event in theirs][-1] == PeerEnded("peer_closed")


async def test_a_connection_that_is_cut_takes_its_path_along() -> None:
    async with over_tcp() as (ours, _, adapter):
        await until(ours, Connected)
        path = ours.peer.ice.path
        adapter.cut()
        async with asyncio.timeout(PATIENCE):
            while ours.peer.ice.path is not None:  # noqa: ASYNC110
                await asyncio.sleep(0.01)
        assert path is not None
        assert not ours.peer.ice.accepts(path)


class Port:
    """A port whose paths are used when it says so."""

    def __init__(self, **settings: float) -> None:
        self.used: set[Path] = set()
        self.is_open = True  # False: nothing that comes is authentic
        self.received: list[bytes] = []
        self.paths: list[Path] = []
        self.closed: list[Path] = []
        self.core = TcpPort(
            self._receive,
            self.closed.append,
            self.used.__contains__,
            TcpPortSettings(**settings),  # type: ignore[arg-type]
        )
        self.number = free_port()
        self.core.bind(HOST, self.number)

    def _receive(self, datagrams: Iterable[tuple[bytes, Path]]) -> None:
        self.received += [data for data, _ in datagrams]
        [path] = {path for _, path in datagrams}
        if self.is_open:
            self.used.add(path)
        self.paths.append(path)

    async def until(self, condition: Callable[[], bool]) -> None:
        async with asyncio.timeout(PATIENCE):
            while not condition():  # noqa: ASYNC110
                await asyncio.sleep(0.005)


@asynccontextmanager
async def running(**settings: float) -> AsyncIterator[Port]:
    port = Port(**settings)
    try:
        yield port
    finally:
        port.core.close()
        port.core.close()


async def connected(port: Port, said: bytes = b"") -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
    reader, writer = await asyncio.open_connection(HOST, port.number)
    writer.write(said)
    return reader, writer


async def ended(reader: asyncio.StreamReader) -> None:
    """Returns when the other side has closed the connection, in whatever way."""
    async with asyncio.timeout(PATIENCE):
        with contextlib.suppress(ConnectionResetError):
            assert await reader.read() == b""


async def test_datagrams_come_out_whatever_pieces_they_came_in() -> None:
    async with running() as port:
        _, writer = await connected(port)
        for byte in frame(b"abc") + frame(b"") + frame(b"d"):
            writer.write(bytes((byte,)))
            await writer.drain()
        await port.until(lambda: port.received == [b"abc", b"d"])
        writer.close()
        await port.until(lambda: port.closed == port.paths[:1])


async def test_who_says_nothing_that_counts_is_closed_in_time_and_whoever_is_used_stays() -> None:
    async with running(patience=0.1) as port:
        used, writer = await connected(port, frame(b"check"))
        silent, other = await connected(port)
        await ended(silent)
        assert port.core.counts == {"unused": 1}
        assert not used.at_eof()
        port.used.clear()
        await ended(used)
        for each in (writer, other):
            each.close()


async def test_of_too_many_strangers_the_oldest_goes() -> None:
    async with running(strangers=2, patience=60.0) as port:
        used, writer = await connected(port, frame(b"check"))
        await port.until(lambda: bool(port.used))
        strangers = [await connected(port) for _ in range(3)]
        await ended(strangers[0][0])
        assert port.core.counts == {"too_many_strangers": 1}
        assert not any(each.at_eof() for each in (used, strangers[1][0], strangers[2][0]))
        for each in (writer, *(stranger[1] for stranger in strangers)):
            each.close()


async def test_connections_are_bounded_and_those_that_are_there_stay() -> None:
    async with running(connections=1, patience=60.0) as port:
        first, writer = await connected(port)
        second, other = await connected(port)
        await ended(second)
        assert port.core.counts["too_many_connections"] == 1
        assert not first.at_eof()
        for each in (writer, other):
            each.close()


async def test_whoever_connects_too_often_waits_and_comes_in_later() -> None:
    async with running(accept_rate=10.0, accept_burst=2.0) as port:
        opened = [await connected(port, frame(b"check")) for _ in range(4)]
        await port.until(lambda: len(port.used) == 4)
        assert port.core.counts["put_off"] > 0
        for _, writer in opened:
            writer.close()


async def test_strangers_that_have_become_peers_make_room_for_others() -> None:
    async with running(strangers=2, patience=60.0) as port:
        opened = []
        for number in range(5):
            opened.append(await connected(port, frame(b"check")))
            await port.until(lambda: len(port.used) > number)  # noqa: B023
        assert not port.core.counts
        for _, writer in opened:
            writer.close()


async def test_what_was_accepted_in_the_moment_of_the_end_is_closed() -> None:
    async with running() as port:
        with socket.create_connection((HOST, port.number)) as client:
            [listener] = port.core._listeners.values()
            port.core._accept(listener)
            port.core.close()
            reader, writer = await asyncio.open_connection(sock=client)
            await ended(reader)
            writer.close()


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"\x00\x00" * 100_000, "too_many_empty_frames"),
        (frame(b"x") * 100_000, "too_much_of_a_stranger"),
        (frame(b"x" * 2000) * 100, "too_much_of_a_stranger"),
    ],
)
async def test_a_stranger_that_floods_is_closed_and_nobody_gets_what_it_sent(data: bytes, reason: str) -> None:
    async with running() as port:
        port.is_open = False
        reader, writer = await connected(port, data)
        await ended(reader)
        assert port.core.counts == {reason: 1}
        assert len(port.received) <= STRANGER_DATAGRAMS
        writer.close()


async def test_frames_without_data_keep_a_path_open_and_a_flood_of_them_ends_it() -> None:
    async with running() as port:
        reader, writer = await connected(port, frame(b"check"))
        await port.until(lambda: port.received == [b"check"])
        writer.write(frame(b"") * int(EMPTY_BURST / 2) + frame(b"on"))
        await port.until(lambda: port.received == [b"check", b"on"])
        writer.write(frame(b"") * 100_000)
        await ended(reader)
        assert port.core.counts == {"too_many_empty_frames": 1}
        writer.close()


async def test_a_frame_that_nobody_sends_ends_the_connection() -> None:
    async with running() as port:
        reader, writer = await connected(port, b"\xff\xff")
        await ended(reader)
        assert port.core.counts == {"frame_too_long": 1}
        writer.close()


async def test_for_a_peer_that_does_not_read_no_more_waits_than_the_bound_and_urgent_datagrams_have_room() -> None:
    async with running(unsent=20_000, unsent_urgent=40_000) as port:
        _, writer = await connected(port, frame(b"check"))
        writer.transport.pause_reading()  # type: ignore[attr-defined]
        await port.until(lambda: bool(port.paths))
        [path] = port.paths
        datagram = Datagram(bytes(1200), path)
        while not port.core.counts["backlog"]:
            port.core.send(datagram, urgent=False)
            await asyncio.sleep(0)
        [connection] = port.core._connections.values()
        assert connection._transport.get_write_buffer_size() < 20_000 + 1300
        port.core.send(datagram, urgent=True)
        assert port.core.counts == {"backlog": 1}
        writer.transport.abort()
        await port.until(lambda: bool(port.closed))
        port.core.send(datagram, urgent=True)
        assert port.core.counts == {"backlog": 1, "no_connection": 1}
