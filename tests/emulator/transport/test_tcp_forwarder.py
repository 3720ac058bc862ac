import asyncio
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress

import pytest

from lockstep.emulator.impairment.delay import Constant
from lockstep.emulator.impairment.deliveries import Deliveries
from lockstep.emulator.impairment.impairment import Impairment
from lockstep.emulator.impairment.outages import Outages
from lockstep.emulator.impairment.profile import Profile, TwoWay
from lockstep.emulator.transport.tcp_forwarder import WINDOW, TcpForwarder
from lockstep.protocol.framing import frame
from lockstep.protocol.messages import Hello, LinkRole, Ping, encode_message

SLOW = Impairment(delay=Constant(0.03))
Streams = tuple[asyncio.StreamReader, asyncio.StreamWriter]


class Bridge:
    """Takes connections and hands out their streams."""

    def __init__(self) -> None:
        self._accepted: asyncio.Queue[Streams] = asyncio.Queue(10)
        self._writers: list[asyncio.StreamWriter] = []
        self.server: asyncio.Server | None = None

    def accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._writers.append(writer)
        self._accepted.put_nowait((reader, writer))

    async def next(self) -> Streams:
        async with asyncio.timeout(20):
            return await self._accepted.get()

    def close(self) -> None:
        for writer in self._writers:
            writer.transport.abort()


class Rig:
    def __init__(self, forwarder: TcpForwarder, bridge: Bridge, outages: Outages) -> None:
        self.forwarder = forwarder
        self.bridge = bridge
        self.outages = outages
        self._writers: list[asyncio.StreamWriter] = []

    async def connect(self, begins: bytes) -> tuple[Streams, Streams]:
        """The client's and the bridge's end of a new connection, after the bridge has read its beginning."""
        reader, writer = await asyncio.open_connection(*self.forwarder.address)
        self._writers.append(writer)
        writer.write(begins)
        at_bridge = await self.bridge.next()
        assert await heard(at_bridge[0], len(begins)) == begins
        return (reader, writer), at_bridge

    def close(self) -> None:
        for writer in self._writers:
            writer.transport.abort()


@asynccontextmanager
async def rig_for(profile: Profile) -> AsyncIterator[Rig]:
    bridge, outages, deliveries = Bridge(), Outages(), Deliveries()
    server = await asyncio.start_server(bridge.accept, "127.0.0.1", 0)
    async with server, TcpForwarder(server.sockets[0].getsockname()[:2], profile, 1, outages, deliveries) as forwarder:
        rig = Rig(forwarder, bridge, outages)
        try:
            yield rig
        finally:
            rig.close()
            bridge.close()
    deliveries.close()


def hello(role: LinkRole) -> bytes:
    return frame(encode_message(Hello(role=role)))


async def heard(reader: asyncio.StreamReader, count: int) -> bytes:
    async with asyncio.timeout(20):
        return await reader.readexactly(count)


async def closed(reader: asyncio.StreamReader) -> None:
    """Returns when nothing can come any more."""
    async with asyncio.timeout(20):
        with suppress(ConnectionResetError):
            assert await reader.read() == b""


async def test_each_role_takes_its_own_path_in_both_directions() -> None:
    async with rig_for(Profile("x", robot_media=TwoWay(SLOW, SLOW))) as rig:
        began = time.monotonic()
        (reader, _), (_, writer) = await rig.connect(hello("media"))
        picture = frame(bytes(100_000))
        writer.write(picture)
        assert await heard(reader, len(picture)) == picture
        assert time.monotonic() - began >= 0.06
        await rig.connect(hello("operator"))
        counts = rig.forwarder.statistics
        assert counts["robot_media", "to_robot"].mean_delay == pytest.approx(0.03)
        assert counts["robot_media", "to_operator"].bytes == len(picture)
        assert counts["robot_control", "to_robot"].mean_delay < 0.01


async def test_a_frame_is_one_message_however_it_comes() -> None:
    async with rig_for(Profile("x")) as rig:
        (_, writer), (reader, _) = await rig.connect(hello("operator"))
        ping = frame(encode_message(Ping(id=7)))
        for number in range(len(ping)):
            writer.write(ping[number : number + 1])
            await writer.drain()
        writer.write(ping * 3)
        assert await heard(reader, 4 * len(ping)) == 4 * ping
        assert rig.forwarder.statistics["robot_control", "to_robot"].offered == 5


async def test_what_is_not_framed_passes_as_it_comes() -> None:
    async with rig_for(Profile("x")) as rig:
        (_, writer), (reader, _) = await rig.connect(b"\x16\x03\x01\x00 not a frame")
        writer.write(b"more")
        assert await heard(reader, 4) == b"more"


async def test_the_end_of_one_side_reaches_the_other_behind_what_is_under_way() -> None:
    async with rig_for(Profile("x", robot_control=TwoWay(SLOW, SLOW))) as rig:
        (reader, _), (_, writer) = await rig.connect(hello("operator"))
        last = frame(encode_message(Ping(id=1)))
        writer.write(last + b"\x00\x00")
        writer.close()
        async with asyncio.timeout(20):
            assert await reader.read() == last + b"\x00\x00", "half a frame is passed too"


async def test_a_cut_breaks_connections_and_new_ones_are_taken() -> None:
    async with rig_for(Profile("x")) as rig:
        (reader, _), _ = await rig.connect(hello("operator"))
        rig.forwarder.cut()
        await closed(reader)
        await rig.connect(hello("operator"))


async def test_a_bridge_that_is_not_there_closes_the_connection() -> None:
    async with rig_for(Profile("x")) as rig:
        rig.forwarder._target = ("127.0.0.1", 1)
        reader, writer = await asyncio.open_connection(*rig.forwarder.address)
        writer.write(hello("operator"))
        await closed(reader)
        writer.close()


async def test_a_sender_waits_while_too_much_is_under_way() -> None:
    async with rig_for(Profile("x")) as rig:
        (reader, _), (_, writer) = await rig.connect(hello("media"))
        rig.outages.demand(time.monotonic(), 0.3, hold=True)
        picture = frame(bytes(WINDOW // 4))
        for _ in range(12):
            writer.write(picture)
        flying = rig.forwarder.statistics["robot_media", "to_operator"]
        async with asyncio.timeout(20):
            assert await reader.readexactly(len(picture))
            assert flying.offered < 12, "the rest waits at the sender"
            assert await reader.readexactly(11 * len(picture))
