"""Endpoints and a real coturn, on loopback."""

import asyncio
import base64
import hashlib
import hmac
import time
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any, cast

import pytest

from lockstep.rtc.channels import ChannelMessage
from lockstep.rtc.endpoint import Connection, Endpoint, EndpointSettings
from lockstep.rtc.peer_events import Connected, PeerEvent, Restarted
from lockstep.rtc.sdp import parse_description, write_description
from lockstep.rtc.sockets.turn_client import TurnClient, TurnRefused, open_turn_client
from lockstep.rtc.stun import Kind, Message, parse, serialize
from lockstep.rtc.turn.servers import IceServer, ServerUri, parse_server_uri
from tests.support.turn_server import TURN_SECRET, TurnServer, running_turn_server

HOST = "127.0.0.1"
SECONDS = 20


@pytest.fixture
async def turn(tmp_path: Path) -> AsyncIterator[TurnServer]:
    async with running_turn_server(tmp_path) as running:
        yield running


def server(turn: TurnServer, transport: str = "udp", secret: str = TURN_SECRET) -> IceServer:
    user = f"{int(time.time()) + 600}:test"
    password = base64.b64encode(hmac.new(secret.encode(), user.encode(), hashlib.sha1).digest()).decode()
    return IceServer([turn.uri.replace("transport=udp", f"transport={transport}")], user, password)


async def until(connection: Connection, kind: type) -> PeerEvent:
    async with asyncio.timeout(SECONDS):
        async for event in connection:
            if isinstance(event, kind):
                return event
    raise AssertionError("ended")


@pytest.mark.parametrize("transport", ["udp", "tcp"])
async def test_a_peer_without_addresses_of_its_own_is_reached_through_a_relay_and_moves_to_another(
    turn: TurnServer, transport: str
) -> None:
    async with Endpoint([]) as relayed, Endpoint([HOST]) as direct:
        assert await relayed.ask([server(turn, transport)]) == []
        assert [each.candidate.type for each in relayed.candidates] == ["relay"]
        ours, theirs = relayed.connect(controlling=True), direct.connect(controlling=False)
        offer = parse_description(write_description(ours.offer()))
        ours.accept(theirs.answer(offer, {}))
        await until(ours, Connected)
        channel = ours.open_channel("x")
        ours.send(channel, "through a relay")
        assert await until(theirs, ChannelMessage) == ChannelMessage(channel, "through a relay")
        first = ours.peer.ice.path
        assert await relayed.ask([server(turn, transport)]) == []
        answer = theirs.peer.negotiation.answer_restart(ours.restart(), asyncio.get_running_loop().time())
        theirs.flush()
        ours.accept_restart(answer)
        await until(ours, Restarted)
        assert first is not None
        assert ours.peer.ice.path is not None
        assert ours.peer.ice.path.local != first.local
        ours.send(channel, "through another")
        assert await until(theirs, ChannelMessage) == ChannelMessage(channel, "through another")


async def test_a_server_that_refuses_or_is_not_there_is_named_and_the_others_count(turn: TurnServer) -> None:
    async with Endpoint([HOST]) as endpoint:
        nobody = IceServer([f"turn:{HOST}:9?transport=tcp"], "user", "password")
        troubles = await endpoint.ask([server(turn, secret="another"), nobody, server(turn, "tcp")])
        assert [each.candidate.type for each in endpoint.candidates] == ["host", "relay"]
        refused = [each for each in troubles if isinstance(each, TurnRefused)]
        assert len(troubles) == 2
        assert [each.code for each in refused] == [401]
        assert str(refused[0]).startswith("401")


async def test_a_fault_in_the_questions_to_one_server_is_named_and_the_others_count(
    turn: TurnServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def fails_once(uri: ServerUri, *rest: Any) -> Any:
        if uri.transport == "udp":
            raise ValueError("planted")
        return await open_turn_client(uri, *rest)

    monkeypatch.setattr("lockstep.rtc.sockets.address_servers.open_turn_client", fails_once)
    async with Endpoint([HOST]) as endpoint:
        troubles = await endpoint.ask([server(turn), server(turn, "tcp")])
        assert [each.candidate.type for each in endpoint.candidates] == ["host", "relay"]
        assert [repr(each) for each in troubles] == ["ValueError('planted')"]


async def test_addresses_that_carry_nothing_are_given_back(turn: TurnServer) -> None:
    async with Endpoint([HOST]) as endpoint:
        await endpoint.ask([server(turn)])
        [first] = [each for each in endpoint.candidates if each.candidate.type == "relay"]
        await endpoint.ask([server(turn)])
        [second] = [each for each in endpoint.candidates if each.candidate.type == "relay"]
        assert first.base != second.base
        client = endpoint._servers.client(second.base)
        assert client is not None
        await endpoint.ask([])
        assert client.relayed is None
        assert [each.candidate.type for each in endpoint.candidates] == ["host"]


class Silent(asyncio.DatagramProtocol):
    """A server that answers nothing; `asked` is set once it was asked twice."""

    def __init__(self) -> None:
        self.asked = asyncio.Event()
        self._questions = 0

    def datagram_received(self, data: bytes, addr: object) -> None:
        self._questions += 1
        if self._questions == 2:
            self.asked.set()


async def test_a_timer_is_handled_although_every_turn_of_the_loop_has_a_datagram() -> None:
    loop = asyncio.get_running_loop()
    transport, silent = await loop.create_datagram_endpoint(Silent, local_addr=(HOST, 0))
    port: int = transport.get_extra_info("sockname")[1]
    url = f"turn:{HOST}:{port}?transport=udp"
    client = TurnClient(parse_server_uri(url), IceServer([url], "user", "password"), lambda data: None)
    await loop.create_datagram_endpoint(lambda: client, remote_addr=(HOST, port))
    async with asyncio.timeout(SECONDS):
        while not silent.asked.is_set():  # the request is repeated after half a second
            client.datagram_received(b"datagram", (HOST, port))
            await asyncio.sleep(0)
    client.close()
    transport.close()


class Nat(asyncio.DatagramProtocol):
    """A STUN server that sees everybody at 203.0.113.9."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.transport = transport

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        request = parse(data)
        answer = serialize(Message(Kind.SUCCESS, request.transaction, mapped=("203.0.113.9", addr[1])))
        cast(asyncio.DatagramTransport, self.transport).sendto(answer, addr)


async def test_a_stun_server_tells_how_a_nat_shows_us() -> None:
    transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(Nat, local_addr=(HOST, 0))
    port = transport.get_extra_info("sockname")[1]
    try:
        async with Endpoint([HOST, "127.0.0.2"]) as endpoint:
            assert await endpoint.ask([IceServer([f"stun:{HOST}:{port}"])]) == []
            found = [each for each in endpoint.candidates if each.candidate.type == "srflx"]
            assert found
            assert all(each.candidate.address == ("203.0.113.9", each.base[1]) for each in found)
            line = found[0].candidate.line()
            assert line.endswith(f"raddr {found[0].base[0]} rport {found[0].base[1]}")
    finally:
        transport.close()


async def test_a_server_that_says_nothing_is_waited_for_a_bounded_time() -> None:
    settings = EndpointSettings(ask_seconds=0.3)
    silent, _ = await asyncio.get_running_loop().create_datagram_endpoint(
        asyncio.DatagramProtocol, local_addr=(HOST, 0)
    )
    port = silent.get_extra_info("sockname")[1]
    try:
        async with Endpoint([HOST], settings=settings) as endpoint, asyncio.timeout(SECONDS):
            await endpoint.ask([IceServer([f"stun:{HOST}:{port}"]), IceServer([f"turn:{HOST}:{port}"], "u", "p")])
            assert [each.candidate.type for each in endpoint.candidates] == ["host"]
    finally:
        silent.close()
