"""The connected peers: admits them, sends to them, ends them."""

import asyncio
from collections.abc import AsyncIterator, Callable, Iterator, Sequence
from contextlib import asynccontextmanager

import structlog

from lockstep.protocol.console import ServerMessage, encode_console_message
from lockstep.server.auth.tokens import Identity
from lockstep.server.errors import NotFound, ShuttingDown
from lockstep.server.peers.channels import ChannelName
from lockstep.server.peers.peer import Peer
from lockstep.server.peers.peer_places import PeerPlaceLimits, PeerPlaces
from lockstep.server.peers.webrtc_transport import WebRtcTransport
from lockstep.server.peers.websocket_transport import WebSocketTransport
from lockstep.server.telemetry.metrics import Metrics
from lockstep.server.util.fair_queue import FairQueue

__all__ = ["PeerRegistry"]

log = structlog.get_logger(__name__)

CLOSE_TIMEOUT = 8.0  # s for all peers together


class PeerRegistry:
    """The peers, each of which runs in a task. Enter `running` once: peers are admitted while it is entered.

    Attributes:
        places: keep one while a peer is being negotiated
        ended: connections so far that have ended
        turns: order of the writes to watchers
    """

    def __init__(
        self,
        limits: PeerPlaceLimits,
        metrics: Metrics,
        further_bounds: Sequence[Callable[[Identity], None]] = (),
    ) -> None:
        """`further_bounds`: each raises TooManyPeers where there is no place for one more peer of this identity."""
        self._metrics = metrics
        self._tasks: asyncio.TaskGroup | None = None  # of the peers; None before and after `running`
        self._sessions: dict[Peer, asyncio.Task[None]] = {}
        self.places = PeerPlaces(limits, self._sessions.keys(), further_bounds)
        self.ended = 0
        self.turns = FairQueue()

    @asynccontextmanager
    async def running(self) -> AsyncIterator[None]:
        """Admit peers while entered; then end all of them, which takes `CLOSE_TIMEOUT` and a little more at most."""
        try:
            async with asyncio.TaskGroup() as self._tasks:
                try:
                    yield
                finally:
                    await self._close()
        finally:
            self._tasks = None

    def __iter__(self) -> Iterator[Peer]:
        return iter(list(self._sessions))

    def __len__(self) -> int:
        return len(self._sessions)

    def drivers(self) -> list[Peer]:
        """Return the peers whose role may drive."""
        return [peer for peer in self._sessions if peer.role != "observer"]

    def observers(self) -> list[Peer]:
        """Return the observers that get feedback from here, and not from a relay."""
        return [peer for peer in self._sessions if peer.role == "observer" and not peer.relay]

    def admit(self, peer: Peer) -> None:
        """Run a peer, for which a place was kept. Raises ShuttingDown."""
        if self._tasks is None or self.places.closed:
            raise ShuttingDown("the console is shutting down")
        self._sessions[peer] = self._tasks.create_task(self._run(peer), name=f"peer {peer.id}")
        self._metrics.peers.labels(peer.role).inc()
        with peer.contained("join"):
            peer.host.peer_joined(peer)
        log.info("peer joined", peer=peer.id, role=peer.role, name=peer.name)

    def by_id(self, peer_id: str) -> Peer | None:
        return next((peer for peer in self._sessions if peer.id == peer_id), None)

    def by_resource(self, resource: str) -> tuple[Peer, WebRtcTransport]:
        """Return the peer with this WHEP resource. Raises NotFound if there is no such peer."""
        for peer in self._sessions:
            transport = peer.transport
            if isinstance(transport, WebRtcTransport) and transport.resource == resource:
                return peer, transport
        raise NotFound("no such WHEP resource")

    def by_ticket(self, ticket: str) -> tuple[Peer, WebSocketTransport]:
        """Return the peer that waits for this ticket. Raises NotFound if there is no such peer."""
        for peer in self._sessions:
            transport = peer.transport
            if isinstance(transport, WebSocketTransport) and not peer.ended and transport.ticket == ticket != "":
                return peer, transport
        raise NotFound("no such ticket")

    def announce(self, message: ServerMessage, channel: ChannelName = "session") -> None:
        """Send a message to everyone."""
        text = encode_console_message(message)
        for peer in self._sessions:
            peer.send_text(channel, text)

    def end_all(self, why: str) -> None:
        for peer in self._sessions:
            peer.end(why)

    async def all_gone(self) -> None:
        """Wait until the peers that are here now have left."""
        if self._sessions:
            await asyncio.wait(self._sessions.values())

    async def _close(self) -> None:
        """Admit no more peers and end those that are here."""
        self.places.close()
        self.end_all("shutdown")
        try:
            async with asyncio.timeout(CLOSE_TIMEOUT):
                await self.all_gone()
        except TimeoutError:
            for task in self._sessions.values():
                task.cancel()

    async def _run(self, peer: Peer) -> None:
        """Run a peer. Raises nothing: a fault with one peer must not end the others."""
        try:
            try:
                await peer.run()
            finally:
                del self._sessions[peer]
                self.ended += 1
                self._metrics.peers.labels(peer.role).dec()
                self._metrics.peers_ended.labels(peer.ended).inc()
                self._metrics.dropped.labels("channel").inc(peer.transport.lost)
                log.info("peer left", peer=peer.id, role=peer.role, name=peer.name, why=peer.ended)
        except Exception as error:
            self._metrics.faults.caught("peer", error, peer=peer.id)
