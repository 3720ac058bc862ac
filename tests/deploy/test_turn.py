"""A real coturn, started by deploy/start-turn: what whoever has its credentials reaches, and what not."""

import asyncio
import base64
import hashlib
import hmac
import ipaddress
import os
import subprocess
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from aioice import stun, turn

from lockstep.bench.harness.free_port import free_port
from lockstep.bench.harness.processes import started
from lockstep.rtc.interfaces import own_addresses
from tests.waiting import PATIENCE

START_TURN = Path(__file__).resolve().parents[2] / "deploy" / "start-turn"
SECRET, REALM = "only for tests, only on this machine", "lockstep.test"
TCP, UDP = 0x06000000, 0x11000000  # REQUESTED-TRANSPORT
FORBIDDEN = 403


def _own_address() -> str:
    found = [each for each in own_addresses() if ":" not in each]
    if not found:
        pytest.skip("this machine has no address but loopback")
    return found[0]


def _credentials() -> tuple[str, str]:
    user = f"{int(time.time()) + 600}:test"
    return user, base64.b64encode(hmac.new(SECRET.encode(), user.encode(), hashlib.sha1).digest()).decode()


@asynccontextmanager
async def _turn_server(folder: Path, **environment: str) -> AsyncIterator[int]:
    port, secret = free_port(), folder / "turn_secret"
    secret.write_text(SECRET)
    given = {"REALM": REALM, "TURN_SECRET_FILE": str(secret), "TURN_PORT": str(port)}
    ports = {"TURN_MIN_PORT": "49500", "TURN_MAX_PORT": "49560"}
    async with started(("/bin/sh", str(START_TURN)), environment=given | ports | environment) as server:
        await server.listening(port)
        yield port


class _Echo(asyncio.DatagramProtocol):
    def __init__(self) -> None:
        self.heard = 0

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.transport: Any = transport

    def datagram_received(self, data: bytes, addr: tuple[Any, ...]) -> None:
        self.heard += 1
        self.transport.sendto(data, addr)


class _Relayed(asyncio.DatagramProtocol):
    def __init__(self) -> None:
        self.came = asyncio.Event()

    def datagram_received(self, data: bytes, addr: tuple[Any, ...]) -> None:
        self.came.set()


@asynccontextmanager
async def _relay(port: int) -> AsyncIterator[tuple[Any, _Relayed]]:
    """An allocation, by somebody with good credentials."""
    user, password = _credentials()
    transport, protocol = await turn.create_turn_endpoint(
        _Relayed, server_addr=("127.0.0.1", port), username=user, password=password
    )
    try:
        yield transport, protocol
    finally:
        transport.close()


async def _permission(transport: Any, address: str) -> int:
    """The error code that a permission for this peer is answered with; 0 when it is given (RFC 8656 9)."""
    request = stun.Message(message_method=stun.Method.CREATE_PERMISSION, message_class=stun.Class.REQUEST)
    request.attributes["XOR-PEER-ADDRESS"] = (address, 9)
    try:
        await transport._TurnTransport__inner_protocol.request_with_retry(request)
    except stun.TransactionFailed as error:
        return int(error.response.attributes["ERROR-CODE"][0])
    return 0


async def test_the_consoles_media_are_reached_through_the_relay_and_no_other_address_is(tmp_path: Path) -> None:
    own = _own_address()
    loop = asyncio.get_running_loop()
    async with _turn_server(tmp_path, EXTERNAL_IP=own) as port, _relay(port) as (transport, relayed):
        console, echo = await loop.create_datagram_endpoint(_Echo, local_addr=(own, 0))
        transport.sendto(b"media", console.get_extra_info("sockname"))
        async with asyncio.timeout(PATIENCE):
            await relayed.came.wait()
        assert echo.heard == 1
        console.close()
        for address in (
            *("127.0.0.1", "0.0.0.0", "10.1.2.3", "169.254.169.254", "192.168.1.1", "172.17.0.1", "100.64.0.1"),
            *("198.18.0.1", "192.0.0.8", "8.8.8.8"),
        ):
            if address != own:
                assert await _permission(transport, address) == FORBIDDEN, address


async def test_for_a_console_that_uses_the_relay_itself_public_addresses_are_reached_and_no_private_one(
    tmp_path: Path,
) -> None:
    async with (
        _turn_server(tmp_path, CONSOLE_IPS=_own_address(), RELAY_TO_PUBLIC="1") as port,
        _relay(port) as (transport, _),
    ):
        assert await _permission(transport, "8.8.8.8") == 0
        assert await _permission(transport, _own_address()) == 0
        for address in (
            "127.0.0.1",
            "10.1.2.3",
            "169.254.169.254",
            "198.18.0.1",
            "198.19.9.9",
            "192.0.0.8",
            "100.64.0.1",
        ):
            assert await _permission(transport, address) == FORBIDDEN, address


def _denied(folder: Path, **environment: str) -> list[tuple[int, int, int]]:
    """Version, first and last of the ranges that coturn is told to deny: this machine need not have IPv6 for that."""
    said = folder / "turnserver"
    said.write_text('#!/bin/sh\nprintf "%s\\n" "$@"\n')
    said.chmod(0o755)
    (folder / "turn_secret").write_text(SECRET)
    given = {"REALM": REALM, "TURN_SECRET_FILE": str(folder / "turn_secret"), "PATH": f"{folder}:{os.environ['PATH']}"}
    flags = subprocess.run(
        ["/bin/sh", str(START_TURN)], env=os.environ | given | environment, check=True, capture_output=True, text=True
    ).stdout.splitlines()
    ranges = [flag.partition("=")[2].split("-") for flag in flags if flag.startswith("--denied-peer-ip=")]
    ends = [(ipaddress.ip_address(first), ipaddress.ip_address(last)) for first, last in ranges]
    return [(first.version, int(first), int(last)) for first, last in ends]


def _is_denied(ranges: list[tuple[int, int, int]], address: str) -> bool:
    wanted = ipaddress.ip_address(address)
    return any(version == wanted.version and first <= int(wanted) <= last for version, first, last in ranges)


NOT_PUBLIC = (
    *("127.0.0.1", "10.1.2.3", "172.16.0.1", "192.168.1.1", "169.254.169.254", "100.64.0.1", "192.0.0.8", "198.18.0.1"),
    *("192.0.2.1", "224.0.0.1", "255.255.255.255", "::1", "fe80::1", "fd00::1", "ff02::1", "::ffff:10.0.0.1"),
    *("64:ff9b::7f00:1", "64:ff9b:1::1", "2002:7f00:1::", "2001::1", "2001:db8::1", "100::1"),
)


def test_no_private_address_is_reached_by_way_of_ipv6_either(tmp_path: Path) -> None:
    public = _denied(tmp_path, CONSOLE_IPS="192.0.2.7", RELAY_TO_PUBLIC="1")
    assert [each for each in NOT_PUBLIC if not _is_denied(public, each)] == []
    assert not any(_is_denied(public, each) for each in ("8.8.8.8", "2a00:1450::1", "2606:4700::1"))
    alone = _denied(tmp_path, CONSOLE_IPS="192.0.2.7")
    assert all(_is_denied(alone, each) for each in (*NOT_PUBLIC, "8.8.8.8", "2a00:1450::1"))


async def test_nobody_gets_a_tcp_connection_to_this_machines_services(tmp_path: Path) -> None:
    """RFC 6062 4.1: it begins with an allocation for TCP, over TCP."""
    async with _turn_server(tmp_path, EXTERNAL_IP=_own_address()) as port:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        first = await _allocate(reader, writer, TCP, {})
        assert first.attributes["ERROR-CODE"][0] == 401
        user, password = _credentials()
        known = {"USERNAME": user, "REALM": REALM, "NONCE": first.attributes["NONCE"]}
        key = hashlib.md5(f"{user}:{REALM}:{password}".encode()).digest()
        answer = await _allocate(reader, writer, TCP, known, key)
        assert answer.message_class == stun.Class.ERROR, "there is a TCP relay"
        writer.close()


async def _allocate(
    reader: asyncio.StreamReader,
    writer: asyncio.StreamWriter,
    transport: int,
    attributes: dict[str, Any],
    key: bytes | None = None,
) -> stun.Message:
    request = stun.Message(message_method=stun.Method.ALLOCATE, message_class=stun.Class.REQUEST)
    request.attributes["REQUESTED-TRANSPORT"] = transport
    request.attributes.update(attributes)
    if key is not None:
        request.add_message_integrity(key)
    writer.write(bytes(request))
    async with asyncio.timeout(PATIENCE):
        head = await reader.readexactly(stun.HEADER_LENGTH)
        body = await reader.readexactly(int.from_bytes(head[2:4], "big"))
    return stun.parse_message(head + body)
