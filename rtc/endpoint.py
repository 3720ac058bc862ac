"""The shell around the cores: one UDP port for many peers, on asyncio.

    async with Endpoint(["192.0.2.7"], 40000) as endpoint:
        connection = endpoint.connect(controlling=False)
        answer = connection.answer(parse_description(offer), {"0": LocalMedia(...)})
        ... signalling brings write_description(answer) to the peer
        async for event in connection:
            ...

With `rtc.udp_socket`, this is the only file of the package that has sockets, a clock and timers. It decides nothing.
"""

import asyncio
import time
from collections import Counter, deque
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from types import TracebackType
from typing import Self

from rtc.addresses import Address, Datagram
from rtc.certificate import Certificate
from rtc.dcep import Reliability
from rtc.dtls import dtls_context
from rtc.ice.agent import Agent
from rtc.ice.gathering import Advertised, gather
from rtc.ice.port import Port, PortSettings
from rtc.peer import OfferedMedia, Peer, PeerSettings
from rtc.peer_events import PacketReceived, PeerEnded, PeerEvent
from rtc.sdp import LocalMedia, SessionDescription
from rtc.udp_socket import UdpSocket

__all__ = ["Connection", "Endpoint", "EndpointSettings", "TooManyPeers"]


class TooManyPeers(RuntimeError):
    """The endpoint has as many peers as its settings allow."""


@dataclass(frozen=True, slots=True)
class EndpointSettings:
    peer: PeerSettings = field(default_factory=PeerSettings)
    port: PortSettings = field(default_factory=PortSettings)
    peers: int = 1024  # at a time; each has half a megabyte of buffers at the most
    waiting_packets: int = 4096  # media packets that an application has not read; more are dropped and counted
    waiting_events: int = 16_384  # of all kinds; an application that lets more wait does not live: the peer is closed


class Connection:
    """One peer: `rtc.peer.Peer` with a clock and a socket. Its events come by `async for`, once."""

    def __init__(self, endpoint: "Endpoint", peer: Peer, settings: EndpointSettings) -> None:
        self.peer = peer
        self.urgent = False  # whether its datagrams leave before those of others
        self.counts: Counter[str] = Counter()
        self._endpoint = endpoint
        self._settings = settings
        self._loop = asyncio.get_running_loop()
        self._timer: asyncio.TimerHandle | None = None
        self._waiting: deque[PeerEvent] = deque()
        self._arrived = asyncio.Event()
        self._ended = False  # PeerEnded is among those that wait, or was read

    # Negotiation: as of `Peer`

    def answer(self, offer: SessionDescription, media: Mapping[str, LocalMedia]) -> SessionDescription:
        answer = self.peer.answer(offer, media, self._loop.time())
        self.flush()
        return answer

    def offer(self, media: Sequence[OfferedMedia] = (), *, data: bool = True) -> SessionDescription:
        return self.peer.offer(media, data=data)

    def accept(self, answer: SessionDescription) -> None:
        self.peer.accept(answer, self._loop.time())
        self.flush()

    def add_candidate(self, line: str) -> None:
        self.peer.add_candidate(line)
        self.flush()

    # Sending: as of `Peer`

    def open_channel(self, label: str, *, protocol: str = "", reliability: Reliability | None = None) -> int:
        channel = self.peer.open_channel(label, self._loop.time(), protocol=protocol, reliability=reliability)
        self.flush()
        return channel

    def send(self, channel: int, data: str | bytes) -> None:
        self.peer.send(channel, data, self._loop.time())
        self.flush()

    def close_channel(self, channel: int) -> None:
        self.peer.close_channel(channel, self._loop.time())
        self.flush()

    def send_frame(
        self,
        mid: str,
        payloads: Sequence[bytes],
        media_time: int,
        *,
        marker: bool = True,
        values: Mapping[str, bytes] | None = None,
        captured_at: float | None = None,
    ) -> None:
        now = self._loop.time()
        self.peer.send_frame(mid, payloads, media_time, now, marker=marker, values=values, captured_at=captured_at)
        self.flush()

    def request_keyframe(self, mid: str) -> None:
        self.peer.request_keyframe(mid, self._loop.time())
        self.flush()

    def close(self) -> None:
        """Say goodbye. The events end with PeerEnded("closed")."""
        self.peer.close(self._loop.time())
        self.flush()

    # Events

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> PeerEvent:
        while not self._waiting:
            if self._ended:
                raise StopAsyncIteration
            self._arrived.clear()
            await self._arrived.wait()
        return self._waiting.popleft()

    # Inside

    def flush(self) -> None:
        """Send what is due, hand out what happened, and set the timer anew. Call it after you used `peer` itself."""
        for event in self.peer.events():
            self._keep(event)
        self._endpoint.send(self.peer.datagrams_to_send(), urgent=self.urgent)
        self._set_timer()
        if self._ended:
            self._endpoint.forget(self)

    def _keep(self, event: PeerEvent) -> None:
        waiting = len(self._waiting)
        if isinstance(event, PacketReceived) and waiting >= self._settings.waiting_packets:
            self.counts["packet_not_read"] += 1
            return
        if waiting >= self._settings.waiting_events and not isinstance(event, PeerEnded):
            self.counts["event_not_read"] += 1
            self.peer.close(self._loop.time())
            self._loop.call_soon(self.flush)
            return
        self._ended = isinstance(event, PeerEnded)
        self._waiting.append(event)
        self._arrived.set()

    def _set_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        due = self.peer.timer()
        if due is not None:
            self._timer = self._loop.call_at(due, self._due)

    def _due(self) -> None:
        self._timer = None
        self.peer.handle_timer(self._loop.time())
        self.flush()


class Endpoint:
    """Many peers on one UDP port. `counts` has what was dropped before it reached a peer."""

    def __init__(
        self,
        hosts: Sequence[str],
        port: int = 0,
        *,
        certificate: Certificate | None = None,
        advertised: Sequence[Advertised] = (),
        settings: EndpointSettings | None = None,
    ) -> None:
        """
        Args:
            hosts: addresses of this machine, those to prefer first; all have the same port.
            port: 0: a free one.
            certificate: None: a new one.
            advertised: addresses of a 1:1 NAT in front of us.

        Raises:
            OSError: the port cannot be bound.
        """
        self.settings = settings or EndpointSettings()
        self.certificate = certificate or Certificate.generate()
        self.port = Port(self.settings.port)
        self.counts = self.port.counts
        self._context = dtls_context(self.certificate)
        self._loop = asyncio.get_running_loop()
        self._sockets: dict[Address, UdpSocket] = {}
        self._flush_is_due = False
        self._connections: dict[Agent, Connection] = {}
        self._hosts = list(hosts)
        self._number = port
        self._advertised = tuple(advertised)
        with ExitStack() as stack:
            stack.callback(self.close)
            for host in hosts:
                self._bind(host)
            stack.pop_all()

    def _bind(self, host: str) -> None:
        found = UdpSocket.bind(host, self._number)
        self._sockets[found.address] = found
        self._number = found.address[1]
        self._loop.add_reader(found.fileno(), self._readable, found)

    def connect(self, *, controlling: bool, settings: PeerSettings | None = None) -> Connection:
        """A connection that is to be negotiated; `controlling` is as of `Peer`. Raises TooManyPeers."""
        if len(self._connections) >= self.settings.peers:
            raise TooManyPeers(f"{len(self._connections)} peers")
        epoch = time.time() - self._loop.time()
        peer = Peer(
            self._context,
            self.certificate.fingerprint,
            gather(self._hosts, self._number, advertised=self._advertised),
            controlling=controlling,
            settings=replace(settings or self.settings.peer, epoch=epoch),
            directory=self.port.directory,
        )
        connection = Connection(self, peer, self.settings)
        self._connections[peer.ice] = connection
        return connection

    def close(self) -> None:
        """Close every connection and the port. Idempotent."""
        for connection in list(self._connections.values()):
            connection.close()
        self._flush()
        for found in self._sockets.values():
            self._loop.remove_reader(found.fileno())
            self._loop.remove_writer(found.fileno())
            found.close()
        self._sockets.clear()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # For connections

    def send(self, datagrams: Sequence[Datagram], *, urgent: bool) -> None:
        """They leave with all others of this turn of the loop."""
        for datagram in datagrams:
            found = self._sockets.get(datagram.local)
            if found is None:
                self.counts["no_socket"] += 1
            else:
                found.queue((datagram,), urgent=urgent)
        if datagrams and not self._flush_is_due:
            self._flush_is_due = True
            self._loop.call_soon(self._flush)

    def forget(self, connection: Connection) -> None:
        self._connections.pop(connection.peer.ice, None)

    # Sockets

    def _readable(self, found: UdpSocket) -> None:
        now = self._loop.time()
        heard: dict[Connection, None] = {}  # in order
        for data, path in found.receive():
            agent = self.port.route(data, path, now)
            connection = self._connections.get(agent) if agent is not None else None
            if connection is not None:
                connection.peer.receive_datagram(data, path, now)
                heard[connection] = None
        for connection in heard:
            connection.flush()

    def _flush(self) -> None:
        self._flush_is_due = False
        for found in self._sockets.values():
            found.flush()
            if found.wants_write:
                self._loop.add_writer(found.fileno(), self._flush)
            else:
                self._loop.remove_writer(found.fileno())
