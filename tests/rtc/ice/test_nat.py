"""Kernels that have nothing in common but a NAT: a console behind an advertised address, and a peer behind a router.

Each side's sockets stand in a network namespace of their own; the NAT between the two rewrites IPv4 packets.
"""

import asyncio
import ctypes
import ipaddress
import os
import socket
import struct
from collections.abc import AsyncIterator, Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import AsyncExitStack, asynccontextmanager

import pytest

from lockstep.emulator.errors import NamespacesUnavailable
from lockstep.emulator.namespace.tun import Tun, open_tun
from lockstep.rtc.addresses import Address, Datagram, Path
from lockstep.rtc.ice.agent import Agent
from lockstep.rtc.ice.events import Ended, PathChanged
from lockstep.rtc.ice.gathering import Advertised, gather
from lockstep.rtc.sockets.udp_socket import UdpSocket
from tests.rtc.ice.sockets import AgentOnSocket

INNER, OUTER = "10.77.0.5", "203.0.113.7"  # of the console: every port of the outer address is forwarded
HOME, ROUTER = "192.168.1.9", "203.0.113.50"  # of the peer, whose router opens one port at a time

Translate = Callable[[Address, Address], tuple[Address, Address] | None]  # source and destination


class Nat:
    """Both NATs. The router lets in only what comes from where its host has sent."""

    def __init__(self) -> None:
        self.router_port = 61000
        self._home_port = 0
        self._opened: set[Address] = set()

    def rebind(self) -> None:
        """The router forgets, as it does after a restart."""
        self.router_port += 1
        self._opened.clear()

    def from_console(self, source: Address, target: Address) -> tuple[Address, Address] | None:
        source = (OUTER, source[1])
        if target != (ROUTER, self.router_port) or source not in self._opened:
            return None
        return source, (HOME, self._home_port)

    def from_peer(self, source: Address, target: Address) -> tuple[Address, Address] | None:
        if target[0] != OUTER:
            return None  # the inner address leads nowhere
        self._home_port = source[1]
        self._opened.add(target)
        return (ROUTER, self.router_port), (INNER, target[1])


def translated(packet: bytes, translate: Translate) -> bytes | None:
    """The IPv4 packet with other addresses; None: it does not pass."""
    header = (packet[0] & 15) * 4
    if packet[0] >> 4 != 4 or packet[9] != socket.IPPROTO_UDP:
        return None
    source_port, target_port = struct.unpack_from("!HH", packet, header)
    ends = translate(
        (str(ipaddress.ip_address(packet[12:16])), source_port), (str(ipaddress.ip_address(packet[16:20])), target_port)
    )
    if ends is None:
        return None
    changed = bytearray(packet)
    changed[10:12] = bytes(2)
    changed[12:20] = b"".join(socket.inet_aton(host) for host, _ in ends)
    struct.pack_into("!HH", changed, header, ends[0][1], ends[1][1])
    changed[header + 6 : header + 8] = bytes(2)  # no checksum (RFC 768)
    total = sum(struct.unpack(f"!{header // 2}H", changed[:header]))
    changed[10:12] = (~((total & 0xFFFF) + (total >> 16)) & 0xFFFF).to_bytes(2)
    return bytes(changed)


def bind_inside(tun: Tun, host: str) -> UdpSocket:
    """A socket belongs to the namespace of the thread that makes it."""

    def bind() -> UdpSocket:
        if ctypes.CDLL(None, use_errno=True).setns(tun.namespace, 0) != 0:
            raise OSError(ctypes.get_errno(), "setns")
        return UdpSocket.bind(host, 0)

    with ThreadPoolExecutor(1) as thread:
        return thread.submit(bind).result()


@asynccontextmanager
async def world() -> AsyncIterator[tuple[Nat, AgentOnSocket, AgentOnSocket]]:
    """The NAT, the console's agent, and the peer's, which controls."""
    nat, loop = Nat(), asyncio.get_running_loop()
    async with AsyncExitStack() as stack:
        try:
            console_side, peer_side = open_tun(INNER), open_tun(HOME)
        except NamespacesUnavailable as reason:
            pytest.skip(str(reason))
        for near, far, translate in (
            (console_side, peer_side, nat.from_console),
            (peer_side, console_side, nat.from_peer),
        ):
            stack.callback(near.close)
            loop.add_reader(near.packets, forward, near.packets, far.packets, translate)
            stack.callback(loop.remove_reader, near.packets)
        console_socket, peer_socket = bind_inside(console_side, "0.0.0.0"), bind_inside(peer_side, HOME)
        advertised = [Advertised(OUTER, INNER)]
        console = Agent(gather([INNER], console_socket.address[1], advertised=advertised), controlling=False)
        peer = Agent(gather([HOME], peer_socket.address[1]), controlling=True)
        yield (
            nat,
            await stack.enter_async_context(AgentOnSocket(console, console_socket)),
            await stack.enter_async_context(AgentOnSocket(peer, peer_socket)),
        )


def forward(source: int, target: int, translate: Translate) -> None:
    packet = os.read(source, 65536)
    if (changed := translated(packet, translate)) is not None:
        os.write(target, changed)


def signal(one: AgentOnSocket, other: AgentOnSocket) -> None:
    for each, its_peer in ((one, other), (other, one)):
        candidates = [local.candidate for local in its_peer.agent.local_candidates]
        each.agent.set_remote(its_peer.agent.local_credentials, candidates, each.now)
        each.drain()


def has_nominated(shell: AgentOnSocket, path: Path) -> bool:
    return shell.agent.path == path and PathChanged(path, nominated=True) in shell.events


async def test_an_advertised_address_and_a_router_let_media_through_both_ways() -> None:
    async with world() as (nat, console, peer):
        signal(console, peer)
        inner_port = console.agent.local_candidates[0].base[1]
        to_peer = Path((INNER, inner_port), (ROUTER, nat.router_port))
        await console.until(lambda: has_nominated(console, to_peer))
        await peer.until(lambda: peer.agent.path is not None and peer.agent.path.remote == (OUTER, inner_port))
        console._socket.queue([Datagram(bytes((0x80, 0x60)) + bytes(1198), to_peer)] * 20)
        console._socket.flush()
        await peer.until(lambda: len(peer.data) == 20)


async def test_a_router_that_gives_another_port_is_followed_without_signalling() -> None:
    async with world() as (nat, console, peer):
        signal(console, peer)
        inner_port = console.agent.local_candidates[0].base[1]
        await console.until(lambda: has_nominated(console, Path((INNER, inner_port), (ROUTER, nat.router_port))))
        nat.rebind()
        await console.until(lambda: has_nominated(console, Path((INNER, inner_port), (ROUTER, nat.router_port))))
        assert not any(isinstance(event, Ended) for event in console.events + peer.events)


async def test_a_restart_behind_a_router_that_has_forgotten_ends_on_its_new_port() -> None:
    async with world() as (nat, console, peer):
        signal(console, peer)
        inner_port = console.agent.local_candidates[0].base[1]
        await console.until(lambda: has_nominated(console, Path((INNER, inner_port), (ROUTER, nat.router_port))))
        nat.rebind()
        console.agent.restart(console.now)
        peer.agent.restart(peer.now)
        signal(console, peer)
        await console.until(lambda: has_nominated(console, Path((INNER, inner_port), (ROUTER, nat.router_port))))
