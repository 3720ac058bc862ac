"""The shell around the cores: one UDP port for many peers, on asyncio.

    async with Endpoint(["192.0.2.7"], 40000) as endpoint:
        connection = endpoint.connect(controlling=False)
        answer = connection.answer(parse_description(offer), {"0": LocalMedia(...)})
        ... signalling brings write_description(answer) to the peer
        async for event in connection:
            ...

This module and those of `sockets/` are the only ones of the package with sockets, a clock and timers. They decide
nothing.
"""

import asyncio
import time
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from types import TracebackType
from typing import Self

from lockstep.rtc.addresses import Address, Datagram, Path
from lockstep.rtc.certificate import Certificate
from lockstep.rtc.dtls import dtls_context
from lockstep.rtc.ice.agent import Agent
from lockstep.rtc.ice.check_list import LocalCandidate
from lockstep.rtc.ice.gathering import Advertised, gather
from lockstep.rtc.ice.port import Port
from lockstep.rtc.peer import Peer, PeerSettings
from lockstep.rtc.sockets.address_servers import AddressServers
from lockstep.rtc.sockets.connection import Connection, Turns
from lockstep.rtc.sockets.endpoint_settings import EndpointSettings
from lockstep.rtc.sockets.event_delivery import Listener
from lockstep.rtc.sockets.port_sockets import PortSockets
from lockstep.rtc.sockets.tcp_port import TcpPort
from lockstep.rtc.sockets.udp_socket import UdpSocket
from lockstep.rtc.turn.servers import IceServer

__all__ = ["Connection", "Endpoint", "EndpointSettings", "Listener", "TooManyPeers", "Turns"]


class TooManyPeers(RuntimeError):
    """The endpoint has as many peers as its settings allow."""


class Endpoint:
    """Many peers on one UDP port. `counts` has the datagrams that were dropped before they reached a peer.

    Iterate `sockets` for the UDP sockets: their `fileno` tells an application when something has come.
    """

    def __init__(
        self,
        hosts: Sequence[str],
        port: int = 0,
        *,
        tcp: bool = False,
        certificate: Certificate | None = None,
        advertised: Sequence[Advertised] = (),
        settings: EndpointSettings | None = None,
    ) -> None:
        """Bind the sockets.

        Args:
            hosts: addresses of this machine, the preferred ones first; all have the same port. None at all: peers reach
                this endpoint through TURN servers only (`ask`).
            port: 0: a free one.
            tcp: True: peers may connect by TCP as well (RFC 6544), to the port of the same number.
            certificate: None: a new one.
            advertised: addresses of a 1:1 NAT in front of this machine.

        Raises:
            OSError: the port cannot be bound.
        """
        self.settings = settings or EndpointSettings()
        self.certificate = certificate or Certificate.generate()
        self.port = Port(self.settings.port)
        self.counts = self.port.counts
        self._context = dtls_context(self.certificate)
        self._loop = asyncio.get_running_loop()
        self._dropped_before: Counter[str] = Counter()  # of connections that have ended
        self._connections: dict[Agent, Connection] = {}
        self._advertised = tuple(advertised)
        self._servers = AddressServers(self.settings, self.counts, partial(self.send, urgent=False), self._receive)
        is_used = self.port.directory.has_owner
        tcp_port = TcpPort(self._receive, self._stream_closed, is_used, self.settings.tcp) if tcp else None
        self.sockets = PortSockets(self._receive, tcp_port)
        self.sockets.bind_all(hosts, port)

    @property
    def connections(self) -> int:
        """The number of connections that have not ended."""
        return len(self._connections)

    @property
    def dropped(self) -> Counter[str]:
        """Counts of unused input since the start, by reason: here, and of every connection."""
        found = Counter(self.counts) + self._dropped_before
        for connection in self._connections.values():
            found += connection.peer.dropped + connection.counts
        return found

    # Addresses for peers

    @property
    def candidates(self) -> list[LocalCandidate]:
        """The candidates of the local addresses, and those that servers reported."""
        sockets = self.sockets
        tcp = sockets.number if sockets.tcp is not None else None
        return [*gather(sockets.hosts, sockets.number, tcp, self._advertised), *self._servers.told]

    def use_hosts(self, hosts: Sequence[str]) -> None:
        """Use these local addresses after a change of the network. Those that cannot be bound are left out.

        A socket of an address that is gone stays, for it costs nothing and the address may come back.
        """
        self.sockets.use_hosts(hosts, self.counts)

    async def ask(self, servers: Sequence[IceServer]) -> list[Exception]:
        """Ask STUN servers for the mapped address, and TURN servers for relayed ones; `candidates` has the answers.

        Earlier relayed addresses that carry no data are given back. Return the errors of servers without an answer:
        `OSError`, of which `TurnRefused` has the server's reason, and anything else for a fault of this endpoint.
        """
        in_use = set[Address]()
        for each in self._connections.values():
            path = each.peer.ice.path
            # A connection that looks for its path may find it through any of them.
            in_use.update([path.local] if path is not None else [x.base for x in each.peer.ice.local_candidates])
        self._servers.give_back_unused(in_use)
        hosts = self.sockets.hosts
        return await self._servers.ask(servers, [each.address for each in self.sockets if each.address[0] in hosts])

    def connect(
        self,
        *,
        controlling: bool,
        settings: PeerSettings | None = None,
        listener: Listener | None = None,
        turns: Turns | None = None,
    ) -> Connection:
        """Return a connection that is to be negotiated. Raises TooManyPeers.

        Args:
            controlling: as in `Peer`
            listener: gets its events as they happen; it may use the connection, and closes nothing else
            turns: decides when to handle the peer's datagrams; None: at once
        """
        if len(self._connections) >= self.settings.peers:
            raise TooManyPeers(f"{len(self._connections)} peers")
        epoch = time.time() - self._loop.time()
        peer = Peer(
            self._context,
            self.certificate.fingerprint,
            self.candidates,
            controlling=controlling,
            settings=replace(settings or self.settings.peer, epoch=epoch),
            directory=self.port.directory,
        )
        connection = Connection(self, peer, self.settings, listener, turns)
        self._connections[peer.ice] = connection
        return connection

    def close(self) -> None:
        """Close every connection and the port. Idempotent."""
        for connection in list(self._connections.values()):
            connection.close()
        self._servers.close()
        self.sockets.close()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # For connections

    def send(self, datagrams: Sequence[Datagram], *, urgent: bool) -> None:
        """Send datagrams with all others of this turn of the loop; urgent ones now."""
        sockets = self.sockets
        if not datagrams or (urgent and len(datagrams) == 1 and sockets.send_at_once(datagrams[0])):
            return
        used: UdpSocket | None = None
        for datagram in datagrams:
            if sockets.tcp is not None and datagram.path.transport == "tcp":
                sockets.tcp.send(datagram, urgent=urgent)
                continue
            found = sockets.by_address.get(datagram.local)
            if found is None:
                self._servers.send(datagram)
                continue
            if urgent and used is not None and used is not found:
                sockets.flush_socket(used)
            found.queue((datagram,), urgent=urgent)
            used = found
        if used is None:
            return
        if urgent:
            sockets.flush_socket(used)
        elif not sockets.flush_is_due:
            sockets.flush_later()

    def is_blocked(self, path: Path) -> bool:
        """True if data sent on this path now would only wait for the network."""
        return self.sockets.is_blocked(path)

    def forget(self, connection: Connection) -> None:
        if self._connections.pop(connection.peer.ice, None) is not None:
            self._dropped_before += connection.peer.dropped + connection.counts

    # For the sockets

    def _receive(self, datagrams: Iterable[tuple[bytes, Path]]) -> None:
        now = self._loop.time()
        probes = self._servers.probes
        heard: dict[Connection, bool] = {}  # in order; True: more than plain packets came
        for data, path in datagrams:
            if probes and path in probes:
                self._servers.received(data, path, now)
                continue
            agent = self.port.route(data, path, now)
            connection = self._connections.get(agent) if agent is not None else None
            if connection is None or connection.put_off(data, path):
                continue
            if connection.receive(data, path, now):
                if connection.urgent and connection.peer.has_message:
                    heard.pop(connection, None)
                    connection.settle()  # a command does not wait for the datagrams behind it
                    now = self._loop.time()  # settling may have sent later than `now`, and no core's time runs back
                else:
                    heard[connection] = True
            else:
                heard.setdefault(connection, False)
        for connection, more in heard.items():
            if more:
                connection.settle()
            else:
                connection.hand_out_plain()

    def _stream_closed(self, path: Path) -> None:
        agent = self.port.directory.owner(path)
        connection = self._connections.get(agent) if agent is not None else None
        if connection is not None:
            connection.path_closed(path)
