import asyncio
import re
import socket
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest
from aioice import stun

from lockstep.emulator.errors import BadDescription
from lockstep.emulator.impairment.delay import Constant
from lockstep.emulator.impairment.deliveries import Deliveries
from lockstep.emulator.impairment.impairment import PERFECT, Impairment
from lockstep.emulator.impairment.loss import independent
from lockstep.emulator.impairment.outages import Outages
from lockstep.emulator.impairment.profile import Profile, TwoWay, even_profile
from lockstep.emulator.transport.client_paths import ClientPaths
from lockstep.emulator.transport.udp_forwarder import MAX_RESTARTS, UdpForwarder

CANDIDATE = re.compile(r"127\.0\.0\.1 (\d+) typ host")
LOOPBACK = "127.0.0.1"


class Ends(asyncio.DatagramProtocol):
    """A socket that keeps what it gets."""

    def __init__(self) -> None:
        self.received: asyncio.Queue[tuple[bytes, tuple[str, int]]] = asyncio.Queue(1000)

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        self.received.put_nowait((data, addr))


class End:
    def __init__(self, transport: asyncio.DatagramTransport, ends: Ends) -> None:
        self.transport = transport
        self._ends = ends

    @property
    def port(self) -> int:
        port: int = self.transport.get_extra_info("sockname")[1]
        return port

    def send(self, data: bytes, port: int) -> None:
        self.transport.sendto(data, (LOOPBACK, port))

    async def hear(self) -> tuple[bytes, int]:
        async with asyncio.timeout(20):
            data, address = await self._ends.received.get()
        return data, address[1]

    @property
    def silent(self) -> bool:
        return self._ends.received.empty()


@asynccontextmanager
async def sockets(count: int) -> AsyncIterator[list[End]]:
    loop = asyncio.get_running_loop()
    made = [End(*await loop.create_datagram_endpoint(Ends, local_addr=(LOOPBACK, 0))) for _ in range(count)]
    try:
        yield made
    finally:
        for each in made:
            each.transport.close()


@asynccontextmanager
async def forwarder_for(profile: Profile) -> AsyncIterator[tuple[UdpForwarder, Outages]]:
    deliveries, outages = Deliveries(), Outages()
    forwarder = UdpForwarder(ClientPaths(profile, "1", outages), deliveries)
    try:
        yield forwarder, outages
    finally:
        forwarder.close()
        deliveries.close()


def check(username: str) -> bytes:
    message = stun.Message(message_method=stun.Method.BINDING, message_class=stun.Class.REQUEST)
    message.attributes["USERNAME"] = username
    return bytes(message)


def description(name: str, port: int) -> str:
    return f"a=ice-ufrag:{name}\r\nm=audio 9 X\r\na=candidate:1 1 udp 5 {LOOPBACK} {port} typ host\r\n"


def join(forwarder: UdpForwarder, client: End, console: End, name: str = "console") -> int:
    """The port at which the client finds the forwarder."""
    assert "candidate" not in forwarder.offer(description("client", client.port))
    found = CANDIDATE.findall(forwarder.answer(description(name, console.port)))
    return int(found[0])


async def test_packets_pass_both_ways_once_the_client_has_shown_that_it_knows_the_names() -> None:
    async with forwarder_for(even_profile("x", PERFECT)) as (forwarder, _), sockets(2) as (client, console):
        door = join(forwarder, client, console)
        client.send(check("console:client"), door)
        data, behind = await console.hear()
        assert stun.parse_message(data).attributes["USERNAME"] == "console:client"
        console.send(b"\x80down", behind)
        assert await client.hear() == (b"\x80down", door)
        client.send(b"\x16up", door)
        assert await console.hear() == (b"\x16up", behind)


async def test_strangers_do_not_pass() -> None:
    async with forwarder_for(even_profile("x", PERFECT)) as (forwarder, _), sockets(3) as (client, console, stranger):
        door = join(forwarder, client, console)
        for data in (b"hello", check("console:other"), check("other:client"), check("")):
            stranger.send(data, door)
        client.send(check("console:client"), door)
        await console.hear()
        assert forwarder.strangers == 4
        assert console.silent


async def test_each_address_of_the_client_is_another_one_to_the_console() -> None:
    async with forwarder_for(even_profile("x", PERFECT)) as (forwarder, _), sockets(3) as (client, console, second):
        door = join(forwarder, client, console)
        client.send(check("console:client"), door)
        _, one = await console.hear()
        second.send(check("console:client"), door)
        _, other = await console.hear()
        assert one != other
        console.send(b"to the second", other)
        assert (await second.hear())[0] == b"to the second"
        assert client.silent


async def test_media_and_control_meet_different_networks() -> None:
    nothing = Impairment(loss=independent(1.0))
    profile = Profile("x", media=TwoWay(nothing, nothing))
    async with forwarder_for(profile) as (forwarder, _), sockets(2) as (client, console):
        door = join(forwarder, client, console)
        client.send(check("console:client"), door)
        _, behind = await console.hear()
        console.send(b"\x80media", behind)
        console.send(b"\x16control", behind)
        assert (await client.hear())[0] == b"\x16control"


async def test_an_ice_restart_leads_to_the_consoles_new_address_while_the_old_one_still_works() -> None:
    async with forwarder_for(even_profile("x", PERFECT)) as (forwarder, _), sockets(3) as (client, console, again):
        door = join(forwarder, client, console)
        client.send(check("console:client"), door)
        await console.hear()
        new_door = join(forwarder, client, again, "restarted")
        assert new_door != door
        client.send(check("restarted:client"), new_door)
        _, behind = await again.hear()
        again.send(b"\x80new", behind)
        assert await client.hear() == (b"\x80new", new_door)
        client.send(b"\x80old", door)
        assert (await console.hear())[0] == b"\x80old"


async def test_restarts_are_bounded() -> None:
    async with forwarder_for(even_profile("x", PERFECT)) as (forwarder, _), sockets(2) as (client, console):
        for number in range(MAX_RESTARTS):
            join(forwarder, client, console, f"n{number}")
        with pytest.raises(BadDescription, match="too many"):
            join(forwarder, client, console, "more")


async def test_an_outage_holds_packets_until_its_end_and_the_first_packet_starts_the_schedule() -> None:
    async with (
        forwarder_for(even_profile("x", Impairment(delay=Constant(0.001)))) as (forwarder, outages),
        sockets(2) as (client, console),
    ):
        door = join(forwarder, client, console)
        before = outages.started
        client.send(check("console:client"), door)
        await console.hear()
        assert (before, outages.started) == (False, True)
        began = time.monotonic()
        outages.demand(began, 0.1, hold=True)
        client.send(b"\x16held", door)
        assert (await console.hear())[0] == b"\x16held"
        assert time.monotonic() >= began + 0.1


async def test_a_closed_forwarder_passes_nothing_and_its_ports_are_free() -> None:
    async with forwarder_for(even_profile("x", PERFECT)) as (forwarder, _), sockets(2) as (client, console):
        door = join(forwarder, client, console)
        forwarder.close()
        forwarder.close()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as own:
            own.bind((LOOPBACK, door))


async def test_an_address_that_is_not_ours_is_refused() -> None:
    deliveries = Deliveries()
    forwarder = UdpForwarder(ClientPaths(even_profile("x", PERFECT), "1", Outages()), deliveries, ["192.0.2.250"])
    with pytest.raises(OSError, match="assign"):
        forwarder.answer(description("console", 4000))
    forwarder.close()
    deliveries.close()
