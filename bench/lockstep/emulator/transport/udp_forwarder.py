"""Forwards everything but HTTP between one client and the console, over the paths of a profile.

It puts itself into both descriptions. The console sees a client at the forwarder, the client sees a console there;
neither learns another address. A client may try several of its addresses: each becomes a flow with its own socket
towards the console, as at a NAT, so that ICE can tell them apart.
"""

import asyncio
import socket
import time
from collections.abc import Sequence
from contextlib import suppress

from lockstep.emulator.errors import BadDescription
from lockstep.emulator.impairment.deliveries import Deliveries
from lockstep.emulator.impairment.packets import kind_of, stun_username
from lockstep.emulator.impairment.profile import Direction
from lockstep.emulator.transport.client_paths import ClientPaths
from lockstep.emulator.transport.sdp import (
    Address,
    candidates_replaced,
    console_addresses,
    ice_names,
    reached_from,
    without_candidates,
)

__all__ = ["LOOPBACK", "UdpForwarder"]

LOOPBACK = "127.0.0.1"
MAX_DATAGRAM = 65536
BATCH = 64  # datagrams read in one turn of the loop
BUFFER = 1 << 20  # bytes that a socket keeps: a keyframe is a burst
MAX_FLOWS = 64
MAX_RESTARTS = 20


class _Door:
    """A socket of the forwarder at which the client finds one ICE session of the console."""

    def __init__(self, host: str, console: Address, names: set[str]) -> None:
        self.socket = _udp_socket(host)
        self.console = console
        self.names = names  # of the console's ICE session

    @property
    def address(self) -> Address:
        return Address(*self.socket.getsockname()[:2])


class _Flow:
    """An address of the client that proved to know both ICE names."""

    def __init__(self, door: _Door, client: tuple[str, int]) -> None:
        self.door = door  # the door that the client sends to and hears from
        self.client = client
        self.upstream = _udp_socket()
        self.upstream.connect(door.console)


class UdpForwarder:
    """A forwarder. Call `offer`, then `answer`; packets pass until `close`. Use it inside a running loop.

    An ICE restart is one more `offer` and `answer`, with fragments: the console's new session gets its own sockets.

    Args:
        paths: impairments of the packets
        hosts: this machine's addresses at which the client may find it
    """

    def __init__(self, paths: ClientPaths, deliveries: Deliveries, hosts: Sequence[str] = (LOOPBACK,)) -> None:
        self.strangers = 0  # packets from a sender that does not know the ICE names
        self.unsent = 0  # packets that the system did not take
        self.heard_at = time.monotonic()  # time of the client's last packet
        self._paths = paths
        self._deliveries = deliveries
        self._loop = asyncio.get_running_loop()
        self._hosts = hosts
        self._offered: set[str] = set()  # the client's ICE names
        self._doors: list[_Door] = []
        self._flows: dict[tuple[_Door, tuple[str, int]], _Flow] = {}
        self._closed = False

    def offer(self, sdp: str) -> str:
        """Return the client's offer as the console gets it."""
        self._offered |= ice_names(sdp)
        return without_candidates(sdp)

    def answer(self, sdp: str) -> str:
        """Return the console's answer as the client gets it.

        Raises:
            BadDescription: it names no address of the console.
        """
        console, names = console_addresses(sdp), ice_names(sdp)
        if len(self._doors) >= MAX_RESTARTS * len(self._hosts):
            raise BadDescription("too many ICE restarts")
        opened: list[_Door] = []
        for host in self._hosts:
            door = _Door(host, reached_from(host, console), names)
            self._doors.append(door)
            opened.append(door)
            self._loop.add_reader(door.socket, self._from_client, door)
        return candidates_replaced(sdp, [door.address for door in opened])

    def close(self) -> None:
        """Close the forwarder; packets under way do not arrive. Idempotent."""
        self._closed = True
        for own in (*(door.socket for door in self._doors), *(flow.upstream for flow in self._flows.values())):
            self._loop.remove_reader(own)
            own.close()
        self._doors.clear()
        self._flows.clear()

    def _from_client(self, door: _Door) -> None:
        for _ in range(BATCH):
            try:
                data, address = door.socket.recvfrom(MAX_DATAGRAM)
            except OSError:  # nothing more, or an ICMP error of an earlier packet
                return
            flow = self._flows.get((door, address)) or self._admitted(door, address, data)
            if flow is None:
                self.strangers += 1
                continue
            self.heard_at = time.monotonic()
            self._pass(data, "to_robot", flow)

    def _admitted(self, door: _Door, address: tuple[str, int], data: bytes) -> _Flow | None:
        """Return a new flow if this is an ICE check between client and console (RFC 8445 7.2.2: "theirs:ours")."""
        theirs, _, ours = (stun_username(data) or "").partition(":")
        if theirs not in door.names or ours not in self._offered or len(self._flows) == MAX_FLOWS:
            return None
        flow = _Flow(door, address)
        self._flows[door, address] = flow
        self._loop.add_reader(flow.upstream, self._from_console, flow)
        return flow

    def _from_console(self, flow: _Flow) -> None:
        for _ in range(BATCH):
            try:
                data = flow.upstream.recv(MAX_DATAGRAM)
            except OSError:
                return
            self._pass(data, "to_operator", flow)

    def _pass(self, data: bytes, direction: Direction, flow: _Flow) -> None:
        now = time.monotonic()
        arrives = self._paths.admit(kind_of(data), direction, now, len(data))
        if arrives is not None:
            self._deliveries.at(arrives, self._send, data, direction, flow)

    def _send(self, data: bytes, direction: Direction, flow: _Flow) -> None:
        if self._closed:
            return
        try:
            if direction == "to_robot":
                flow.upstream.send(data)
            else:
                flow.door.socket.sendto(data, flow.client)
        except OSError:  # the buffer is full, or the socket is closed
            self.unsent += 1


def _udp_socket(host: str | None = None) -> socket.socket:
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.setblocking(False)
    with suppress(OSError):
        made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER)
        made.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, BUFFER)
    if host is not None:
        try:
            made.bind((host, 0))
        except OSError:
            made.close()
            raise
    return made
