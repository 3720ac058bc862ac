"""The shell around the cores: one UDP port for many peers, on asyncio.

    async with Endpoint(["192.0.2.7"], 40000) as endpoint:
        connection = endpoint.connect(controlling=False)
        answer = connection.answer(parse_description(offer), {"0": LocalMedia(...)})
        ... signalling brings write_description(answer) to the peer
        async for event in connection:
            ...

This module, `udp_socket`, `tcp_port` and `server_links` are the only ones of the package with sockets, a
clock and timers. They decide nothing.
"""

import asyncio
import secrets
import socket
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from types import TracebackType
from typing import Protocol, Self

from lockstep.rtc.addresses import Address, Datagram, Path
from lockstep.rtc.certificate import Certificate
from lockstep.rtc.dcep import Reliability
from lockstep.rtc.dtls import dtls_context
from lockstep.rtc.ice.agent import Agent
from lockstep.rtc.ice.check_list import LocalCandidate
from lockstep.rtc.ice.gathering import Advertised, gather, reflexive, relayed
from lockstep.rtc.ice.port import Port, PortSettings
from lockstep.rtc.peer import OfferedMedia, Peer, PeerSettings
from lockstep.rtc.peer_events import PacketReceived, PeerEnded, PeerEvent
from lockstep.rtc.sdp import Fragment, LocalMedia, SessionDescription
from lockstep.rtc.sockets.server_links import RelayLink, open_relay
from lockstep.rtc.sockets.tcp_port import TcpPort, TcpPortSettings
from lockstep.rtc.sockets.udp_socket import UdpSocket
from lockstep.rtc.turn.servers import IceServer, MappedAddress, ServerUri, server_uris

__all__ = ["Connection", "Endpoint", "EndpointSettings", "TooManyPeers", "Turns"]

Listener = Callable[[PeerEvent], None]
CLOCK_RESOLUTION = 0.001  # s; a loop may call too early by so much
SLOWEST = 4  # times as long as STUN over UDP: an address by TCP and TLS takes five round trips
UNSENT = 64 * 1024  # bytes on a TCP path; above that pictures should wait, where newer ones replace them
PORT_TRIES = 8  # a free port of one address may be taken at another


class TooManyPeers(RuntimeError):
    """The endpoint has as many peers as its settings allow."""


class Turns(Protocol):
    """Gives connections their turns: the packets of their peers are handled in turn, and delay no other connection."""

    def may_go_at_once(self) -> bool:
        """True if one datagram more need not wait. Asked only where none waits."""

    def add(self, connection: "Connection") -> None:
        """Give `connection` turns: call its `handle_next` until that returns False. It may be waiting already."""


@dataclass(frozen=True, slots=True)
class EndpointSettings:
    peer: PeerSettings = field(default_factory=PeerSettings)
    port: PortSettings = field(default_factory=PortSettings)
    tcp: TcpPortSettings = field(default_factory=TcpPortSettings)
    peers: int = 1024  # at a time; each has at most half a megabyte of buffers
    waiting_packets: int = 4096  # media packets that an application has not read; more are dropped and counted
    ask_seconds: float = 3.0  # time to wait for STUN and TURN servers
    ask_margin: float = 0.2  # s, at least, for the slower servers after the first has answered
    waiting_datagrams: int = 1024  # of a connection that has turns; more are dropped and counted
    waiting_events: int = 16_384  # of all kinds; an application that lets more wait counts as dead: the peer is closed


class Connection:
    """One peer: `lockstep.rtc.peer.Peer` with a clock and a socket.

    Read its events with `async for`, once; or pass a listener, which gets each event as it happens.
    """

    def __init__(
        self,
        endpoint: "Endpoint",
        peer: Peer,
        settings: EndpointSettings,
        listener: Listener | None = None,
        turns: Turns | None = None,
    ) -> None:
        self.peer = peer
        self.urgent = False  # True: its datagrams leave before those of others
        self.counts: Counter[str] = Counter()
        self._endpoint = endpoint
        self._settings = settings
        self._loop = asyncio.get_running_loop()
        self._timer: asyncio.TimerHandle | None = None
        self._timer_at = 0.0
        self._listener = listener
        self._telling = False  # True while the listener is called, which may use this connection
        self._turns = turns
        self._later: deque[tuple[bytes, Path]] = deque()  # datagrams that wait for their turn
        self.fault: Exception | None = None  # the exception that serving it raised, after PeerEnded("failed")
        self._waiting: deque[PeerEvent] = deque()
        self._arrived = asyncio.Event()
        self._ended = False  # PeerEnded waits, or was read

    # Negotiation, as in `Peer`

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

    def answer_restart(self, fragment: Fragment) -> Fragment:
        """Like `Peer.answer_restart`, with the present candidates of the endpoint."""
        answer = self.peer.answer_restart(fragment, self._loop.time(), self._endpoint.candidates)
        self.flush()
        return answer

    def restart(self, candidates: Sequence[LocalCandidate] | None = None) -> Fragment:
        """Like `Peer.restart`. `candidates`: None: the present ones of the endpoint."""
        fragment = self.peer.restart(self._loop.time(), self._endpoint.candidates if candidates is None else candidates)
        self.flush()
        return fragment

    def accept_restart(self, fragment: Fragment) -> None:
        self.peer.accept_restart(fragment, self._loop.time())
        self.flush()

    def cancel_restart(self) -> None:
        self.peer.cancel_restart()
        self.flush()

    # Sending, as in `Peer`

    def open_channel(self, label: str, *, protocol: str = "", reliability: Reliability | None = None) -> int:
        channel = self.peer.open_channel(label, self._loop.time(), protocol=protocol, reliability=reliability)
        self.flush()
        return channel

    def send(self, channel: int, data: str | bytes) -> None:
        self.peer.send(channel, data, self._loop.time())
        if self.fault is not None:
            return
        self._endpoint.send(self.peer.datagrams_to_send(), urgent=self.urgent)
        if self.peer.has_events:
            self.flush()
        else:
            self._set_timer_by(self.peer.channel_timer)

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
        datagrams = self.peer.frame_to_send(
            mid, payloads, media_time, now, marker=marker, values=values, captured_at=captured_at
        )
        self._endpoint.send(datagrams, urgent=self.urgent)
        self._set_timer_by(self.peer.media_timer)

    def send_rtcp(self, packet: bytes) -> None:
        self.peer.send_rtcp(packet)
        self.flush()

    @property
    def is_blocked(self) -> bool:
        """True if data sent now would only wait for the network. True too while there is no path."""
        path = self.peer.ice.path
        return path is None or self._endpoint.is_blocked(path)

    def request_keyframe(self, mid: str) -> None:
        self.peer.request_keyframe(mid, self._loop.time())
        self.flush()

    def limit(self, mid: str, bitrate: int) -> None:
        self.peer.limit(mid, bitrate)

    def close(self) -> None:
        """Say goodbye. The events end with PeerEnded("closed")."""
        if self.fault is None:
            try:
                self.peer.close(self._loop.time())
                self.flush()
            except Exception as error:
                self._fail(error)

    # Events

    def listen(self, listener: Listener) -> None:
        """Pass all further events to `listener`, after those that nobody has read. Only once."""
        self._listener = listener
        self._tell(listener, ())

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> PeerEvent:
        while not self._waiting:
            if self._ended:
                raise StopAsyncIteration
            self._arrived.clear()
            await self._arrived.wait()
        return self._waiting.popleft()

    # Turns

    def handle_next(self) -> bool:
        """Handle one of the datagrams that wait. Return True if more wait."""
        if self._later:
            data, path = self._later.popleft()
            if self.receive(data, path, self._loop.time()):
                self.settle()
            else:
                self.hand_out_plain()
        return bool(self._later)

    # Inside

    def put_off(self, data: bytes, path: Path) -> bool:
        """Let a datagram wait for its turn; drop it if too many wait. Return False if it is to be handled now."""
        if self._turns is None or (not self._later and self._turns.may_go_at_once()):
            return False
        if len(self._later) < self._settings.waiting_datagrams:
            self._later.append((data, path))
            self._turns.add(self)
        else:
            self.counts["receive_overflow"] += 1
        return True

    def receive(self, data: bytes, path: Path, now: float) -> bool:
        """Handle a datagram. Call `settle` then, or `hand_out_plain` if this returns False: it was a plain packet."""
        try:
            if self.peer.receive_plain(data):
                return False
            self.peer.receive_datagram(data, path, now)
        except Exception as error:
            self._fail(error)
        return True

    def path_closed(self, path: Path) -> None:
        """Note that the TCP connection of this path has ended."""
        try:
            self.peer.ice.path_closed(path, self._loop.time())
            self.flush()
        except Exception as error:
            self._fail(error)

    def settle(self) -> None:
        """Do as `flush` after `receive`; an exception ends this connection and no other."""
        if self.fault is None:
            try:
                self._finish(self.peer.settled_events())
            except Exception as error:
                self._fail(error)

    def _fail(self, error: Exception) -> None:
        """End this connection after unexpected input: a fault of this package, which other peers must not feel.

        A listener finds the exception in `fault`; without a listener, the loop's exception handler is told.
        """
        if self.fault is not None:
            return
        self.fault = error
        if self._listener is None:
            self._loop.call_exception_handler({"message": "serving a WebRTC peer failed", "exception": error})
        with suppress(Exception):
            self.peer.ice.close()
        self._later.clear()
        if self._timer is not None:
            self._timer.cancel()
        self._hand_out([PeerEnded("failed", str(error))])
        self._endpoint.forget(self)

    def flush(self) -> None:
        """Send the due datagrams, hand out the events, and set the timer anew. Call it after using `peer` directly."""
        if self.fault is None:
            self._finish(self.peer.events())

    def _finish(self, events: Sequence[PeerEvent]) -> None:
        self._hand_out(events)
        self._endpoint.send(self.peer.datagrams_to_send(), urgent=self.urgent)
        if self.peer.has_events:  # a channel is empty now
            self._hand_out(self.peer.events())
            self._endpoint.send(self.peer.datagrams_to_send(), urgent=self.urgent)
        self._set_timer()
        if self._ended:
            self._later.clear()
            self._endpoint.forget(self)

    def hand_out_plain(self) -> None:
        """Hand out plain packets, in place of `flush` where only `Peer.receive_plain` was called."""
        self._hand_out(self.peer.settled_events())

    def _hand_out(self, events: Sequence[PeerEvent]) -> None:
        if self._listener is not None:
            self._tell(self._listener, events)
            return
        for event in events:
            self._keep(event)

    def _tell(self, listener: Listener, events: Sequence[PeerEvent]) -> None:
        """Call the listener in order, also when it causes further events. An exception is the listener's fault."""
        self._waiting.extend(events)
        if self._telling:
            return
        self._telling = True
        try:
            while self._waiting:
                event = self._waiting.popleft()
                self._ended = self._ended or isinstance(event, PeerEnded)
                try:
                    listener(event)
                except Exception as error:
                    self._loop.call_exception_handler({"message": "a listener failed", "exception": error})
        finally:
            self._telling = False

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
        """Set the timer anew. One that fires too early is left: the next datagram puts off most of them, and no code
        waits for them."""
        due = self.peer.timer()
        if due is None and self._timer is not None:
            self._timer.cancel()
            self._timer = None
        self._set_timer_by(due)

    def _set_timer_by(self, due: float | None) -> None:
        """Let the timer fire at `due` at the latest."""
        if due is None or (self._timer is not None and self._timer_at <= due):
            return
        if self._timer is not None:
            self._timer.cancel()
        self._timer, self._timer_at = self._loop.call_at(due, self._due), due

    def _due(self) -> None:
        self._timer = None
        due, now = self.peer.timer(), self._loop.time()
        if due is None or due > now + CLOCK_RESOLUTION:
            self._set_timer()
            return
        try:
            self.peer.handle_timer(max(now, due))
        except Exception as error:
            self._fail(error)
        self.settle()


class Endpoint:
    """Many peers on one UDP port. `counts` has the datagrams that were dropped before they reached a peer."""

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
        self._sockets: dict[Address, UdpSocket] = {}
        self._tcp: TcpPort | None = None
        self._flush_is_due = False
        self._full = set[UdpSocket]()  # sockets for which the loop watches whether the kernel has room again
        self._dropped_before: Counter[str] = Counter()  # of connections that have ended
        self._connections: dict[Agent, Connection] = {}
        self._hosts = list(hosts)
        self._number = port
        self._advertised = tuple(advertised)
        self._told: list[LocalCandidate] = []  # candidates from servers
        self._relays: list[RelayLink] = []
        self._probes: dict[Path, MappedAddress] = {}
        self._probed = asyncio.Event()  # one of the probes has received something
        if tcp:
            self._tcp = TcpPort(self._receive_stream, self._stream_closed, self._is_used, self.settings.tcp)
        for left in reversed(range(PORT_TRIES)):
            try:
                self._bind_all()
                break
            except OSError:
                self.close()
                if port or not left:
                    raise
                self._number = 0

    def _bind_all(self) -> None:
        for host in self._hosts:
            self._bind(host)

    def _bind(self, host: str) -> None:
        found = UdpSocket.bind(host, self._number)
        self._sockets[found.address] = found
        self._number = found.address[1]
        self._loop.add_reader(found.fileno(), self._readable, found)
        if self._tcp is not None:
            self._tcp.bind(host, self._number)

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
    def sockets(self) -> list[UdpSocket]:
        """The UDP sockets, for an application that wants to know when something has come, by `fileno`."""
        return list(self._sockets.values())

    @property
    def candidates(self) -> list[LocalCandidate]:
        """The candidates of the local addresses, and those that servers reported."""
        tcp = self._number if self._tcp is not None else None
        return [*gather(self._hosts, self._number, tcp, self._advertised), *self._told]

    def use_hosts(self, hosts: Sequence[str]) -> None:
        """Use these local addresses after a change of the network. Those that cannot be bound are left out.

        A socket of an address that is gone stays, for it costs nothing and the address may come back.
        """
        known = {address[0] for address in self._sockets}
        for host in hosts:
            if host not in known:
                try:
                    self._bind(host)
                except OSError:
                    self.counts["host_not_bound"] += 1
        bound = {address[0] for address in self._sockets}
        self._hosts = [host for host in hosts if host in bound]

    async def ask(self, servers: Sequence[IceServer]) -> list[Exception]:
        """Ask STUN servers for the mapped address, and TURN servers for relayed ones; `candidates` has the answers.

        Earlier relayed addresses that carry no data are given back. Return the errors of servers without an answer:
        `OSError`, of which `RelayRefused` has the server's reason, and anything else for a fault of this endpoint.
        """
        self._give_back_unused()
        uris = sorted(server_uris(servers, self.counts), key=lambda each: each[0].scheme, reverse=True)  # TURN first
        begun = self._loop.time()
        deadline = begun + self.settings.ask_seconds
        try:
            async with asyncio.TaskGroup() as group:
                tasks = [group.create_task(self._ask_server(*each)) for each in uris]
                left = set(tasks)
                while left and self._loop.time() < deadline:
                    done, left = await asyncio.wait(
                        left, timeout=deadline - self._loop.time(), return_when=asyncio.FIRST_COMPLETED
                    )
                    if any(isinstance(each.result(), list) for each in done):
                        now = self._loop.time()
                        deadline = min(deadline, now + max(self.settings.ask_margin, SLOWEST * (now - begun)))
                for task in left:
                    task.cancel()
        finally:
            self._probes.clear()
        outcomes = [task.result() for task in tasks if not task.cancelled()]
        self._told = [each for found in outcomes if isinstance(found, list) for each in found]
        return [each for each in outcomes if isinstance(each, Exception)]

    async def _ask_server(self, uri: ServerUri, server: IceServer) -> list[LocalCandidate] | Exception:
        """Return what a server answers, or its error, which does not end the questions to others."""
        try:
            return await (self._ask_turn(uri, server) if uri.scheme == "turn" else self._ask_stun(uri))
        except Exception as error:
            return error

    async def _ask_turn(self, uri: ServerUri, server: IceServer) -> list[LocalCandidate]:
        link = await open_relay(uri, server, self._relayed)
        self._relays.append(link)
        address = link.relayed
        return [] if address is None else [relayed(address, link.mapped, len(self._relays))]

    async def _ask_stun(self, uri: ServerUri) -> list[LocalCandidate]:
        found = await self._loop.getaddrinfo(uri.host, uri.port, type=socket.SOCK_DGRAM)
        probes: dict[Address, MappedAddress] = {}
        for base, of_base in self._sockets.items():
            family = socket.AF_INET6 if ":" in base[0] else socket.AF_INET
            remote = next((each[4] for each in found if each[0] == family), None)
            if remote is not None and base[0] in self._hosts:
                path = Path(base, (str(remote[0]), int(remote[1])))
                self._probes[path] = probes[base] = MappedAddress(secrets.token_bytes)
                probes[base].start(self._loop.time())
                self._send_probe(path, of_base)
        await self._until_answered(list(probes.values()))
        return [
            reflexive(probe.mapped, base, place)
            for place, (base, probe) in enumerate(probes.items())
            if probe.mapped is not None and probe.mapped != base
        ]

    async def _until_answered(self, probes: Sequence[MappedAddress]) -> None:
        """Wait until one probe is answered, which is enough: other sockets may have no way to the server."""
        while not any(each.mapped is not None for each in probes) and not all(each.done for each in probes):
            due = min((each for each in (probe.timer() for probe in probes) if each is not None), default=None)
            self._probed.clear()
            try:
                async with asyncio.timeout_at(due):
                    await self._probed.wait()
            except TimeoutError:
                for path, probe in self._probes.items():
                    if probe in probes and (at := probe.timer()) is not None and at <= self._loop.time():
                        probe.handle_timer(self._loop.time())
                        self._send_probe(path, self._sockets[path.local])

    def _send_probe(self, path: Path, found: UdpSocket) -> None:
        self.send([Datagram(data, path) for data in self._probes[path].data_to_send()], urgent=False)

    def _give_back_unused(self) -> None:
        in_use = set[Address]()
        for each in self._connections.values():
            path = each.peer.ice.path
            # A connection that looks for its path may find it through any of them.
            in_use.update([path.local] if path is not None else [x.base for x in each.peer.ice.local_candidates])
        for link in [each for each in self._relays if each.relayed not in in_use]:
            link.close()
            self._relays.remove(link)

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
        for link in self._relays:
            link.close()
        self._relays.clear()
        if self._tcp is not None:
            self._tcp.close()
        self._flush()
        for found in self._sockets.values():
            self._loop.remove_reader(found.fileno())
            self._loop.remove_writer(found.fileno())
            found.close()
        self._sockets.clear()
        self._full.clear()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # For connections

    def send(self, datagrams: Sequence[Datagram], *, urgent: bool) -> None:
        """Send datagrams with all others of this turn of the loop; urgent ones now."""
        for datagram in datagrams:
            if self._tcp is not None and datagram.path.transport == "tcp":
                self._tcp.send(datagram, urgent=urgent)
                continue
            found = self._sockets.get(datagram.local)
            if found is None:
                self._send_relayed(datagram)
            else:
                found.queue((datagram,), urgent=urgent)
        if urgent and datagrams:
            self._flush()
        elif datagrams and not self._flush_is_due:
            self._flush_is_due = True
            self._loop.call_soon(self._flush_later)

    def is_blocked(self, path: Path) -> bool:
        """True if data sent on this path now would only wait for the network."""
        if path.transport == "tcp":
            return self._tcp is not None and self._tcp.unsent(path) > UNSENT
        found = self._sockets.get(path.local)
        return found is not None and found.is_full

    def _send_relayed(self, datagram: Datagram) -> None:
        link = next((each for each in self._relays if each.relayed == datagram.local), None)
        if link is None:
            self.counts["no_socket"] += 1
        else:
            link.send(datagram.data, datagram.remote)

    def forget(self, connection: Connection) -> None:
        if self._connections.pop(connection.peer.ice, None) is not None:
            self._dropped_before += connection.peer.dropped + connection.counts

    # Sockets

    def _readable(self, found: UdpSocket) -> None:
        self._receive(found.receive())

    def _receive_stream(self, datagrams: Sequence[bytes], path: Path) -> None:
        self._receive((each, path) for each in datagrams)

    def _receive(self, datagrams: Iterable[tuple[bytes, Path]]) -> None:
        now = self._loop.time()
        heard: dict[Connection, bool] = {}  # in order; True: more than plain packets came
        for data, path in datagrams:
            if self._probes and path in self._probes:
                self._probes[path].receive(data, now)
                self._probed.set()
                continue
            agent = self.port.route(data, path, now)
            connection = self._connections.get(agent) if agent is not None else None
            if connection is None or connection.put_off(data, path):
                continue
            if connection.receive(data, path, now):
                heard[connection] = True
            else:
                heard.setdefault(connection, False)
        for connection, more in heard.items():
            if more:
                connection.settle()
            else:
                connection.hand_out_plain()

    def _relayed(self, data: bytes, path: Path) -> None:
        self._receive([(data, path)])

    def _is_used(self, path: Path) -> bool:
        return self.port.directory.owner(path) is not None

    def _stream_closed(self, path: Path) -> None:
        agent = self.port.directory.owner(path)
        connection = self._connections.get(agent) if agent is not None else None
        if connection is not None:
            connection.path_closed(path)

    def _flush_later(self) -> None:
        self._flush_is_due = False
        self._flush()

    def _flush(self) -> None:
        for found in self._sockets.values():
            found.flush()
            if found.wants_write:
                self._loop.add_writer(found.fileno(), self._flush)
                self._full.add(found)
            elif found in self._full:
                self._loop.remove_writer(found.fileno())
                self._full.remove(found)
