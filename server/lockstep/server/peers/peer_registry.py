"""The connected peers: admits them, sends to them, ends them."""

import asyncio
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Protocol

import structlog

from lockstep.protocol.console import ServerMessage, encode_console_message
from lockstep.server.auth.tokens import Identity
from lockstep.server.errors import NotFound, ShuttingDown, TooManyRequests
from lockstep.server.peers.channels import ChannelName
from lockstep.server.peers.peer import Peer
from lockstep.server.peers.peer_places import check_place
from lockstep.server.peers.webrtc_transport import WebRtcTransport
from lockstep.server.peers.websocket_transport import WebSocketTransport
from lockstep.server.telemetry.metrics import Metrics
from lockstep.server.util.fair_queue import FairQueue

__all__ = ["PeerRegistry"]

log = structlog.get_logger(__name__)

CLOSE_TIMEOUT = 8.0  # s for all peers together


class PeerRegistryLimits(Protocol):
    """The settings that all peers together need."""

    @property
    def max_peers(self) -> int: ...
    @property
    def max_relayed(self) -> int: ...
    @property
    def reserved_places(self) -> int: ...
    @property
    def max_unconnected(self) -> int: ...
    @property
    def max_thumbnails(self) -> int: ...


class PeerRegistry:
    """At most `max_peers` peers. Each runs in a task that this object owns; `close` waits for all of them."""

    def __init__(
        self,
        limits: PeerRegistryLimits,
        metrics: Metrics,
        further_bounds: Sequence[Callable[[Identity], None]] = (),
    ) -> None:
        """`further_bounds`: each raises TooManyPeers where there is no place for one more peer of this identity."""
        self._limits = limits
        self._metrics = metrics
        self._further_bounds = further_bounds
        self._sessions: dict[Peer, asyncio.Task[None]] = {}
        self._reserved: Counter[str] = Counter()  # places of peers that are being negotiated, by token
        self._closing = False
        self.ended = 0  # connections so far that have ended
        self.turns = FairQueue()  # order of the writes to watchers

    def __iter__(self) -> Iterator[Peer]:
        return iter(list(self._sessions))

    def __len__(self) -> int:
        return len(self._sessions)

    @property
    def taken(self) -> int:
        """Places of peers that get media from here, and of peers that are being negotiated."""
        return sum(not peer.relay for peer in self._sessions) + self._reserved.total()

    def taken_by(self, token_id: str) -> int:
        """Return the number of `taken` places that one link has."""
        here = sum(not peer.relay and peer.identity.token_id == token_id for peer in self._sessions)
        return here + self._reserved[token_id]

    @property
    def thumbnails(self) -> int:
        """Number of peers that are small pictures on somebody's overview, not participants."""
        return sum(peer.thumbnail for peer in self._sessions)

    def drivers(self) -> list[Peer]:
        """Return the peers whose role may drive."""
        return [peer for peer in self._sessions if peer.role != "observer"]

    def observers(self) -> list[Peer]:
        """Return the observers that get feedback from here, and not from a relay."""
        return [peer for peer in self._sessions if peer.role == "observer" and not peer.relay]

    @contextmanager
    def place(self, identity: Identity, *, relayed: bool = False, thumbnail: bool = False) -> Iterator[None]:
        """Keep a place while a peer is being negotiated; `check_place` decides which peers get a place.

        `relayed`: the peer gets its media from a relay. Such peers cost little and are counted separately, as are peers
        that get a `thumbnail`.

        Raises:
            TooManyPeers: there is no place for this link.
            TooManyRequests: too many peers of this link have not connected yet.
            ShuttingDown: the console is shutting down.
        """
        if self._closing:
            raise ShuttingDown("the console is shutting down")
        limits, token_id = self._limits, identity.token_id
        bound = limits.max_relayed if relayed else limits.max_thumbnails if thumbnail else limits.max_peers
        alike = [peer for peer in self._sessions if (bool(peer.relay), peer.thumbnail) == (relayed, thumbnail)]
        held = sum(peer.identity.token_id == token_id for peer in alike) + self._reserved[token_id]
        taken = len(alike) + self._reserved.total()
        check_place(identity.role, held, taken, bound, 0 if thumbnail else limits.reserved_places)
        for check in () if relayed else self._further_bounds:
            check(identity)
        waiting = sum(peer.identity.token_id == token_id and not peer.connected for peer in self._sessions)
        if waiting + self._reserved[token_id] >= limits.max_unconnected:
            raise TooManyRequests(f"{limits.max_unconnected} peers of this link have not connected yet")
        self._reserved[token_id] += 1
        try:
            yield
        finally:
            self._reserved[token_id] -= 1
            if self._reserved[token_id] == 0:
                del self._reserved[token_id]

    def admit(self, peer: Peer) -> None:
        task = asyncio.get_running_loop().create_task(self._run(peer), name=f"peer {peer.id}")
        self._sessions[peer] = task
        self._metrics.peers.labels(peer.role).inc()
        with peer.contained("join"):
            peer.joined()
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

    def tell(self, channel: ChannelName, message: ServerMessage) -> None:
        """Send a message to everyone."""
        text = encode_console_message(message)
        for peer in self._sessions:
            peer.send_text(channel, text)

    def announce(self, message: ServerMessage) -> None:
        """Send a message of the session to everyone."""
        self.tell("session", message)

    def end_all(self, why: str) -> None:
        for peer in self._sessions:
            peer.end(why)

    async def all_gone(self) -> None:
        """Wait until the peers that are here now have left."""
        if self._sessions:
            await asyncio.wait(self._sessions.values())

    async def close(self) -> None:
        """Admit no more peers and end those that are here. Idempotent."""
        self._closing = True
        self.end_all("shutdown")
        try:
            async with asyncio.timeout(CLOSE_TIMEOUT):
                await self.all_gone()
        except TimeoutError:
            late = list(self._sessions.values())
            for task in late:
                task.cancel()
            await asyncio.gather(*late, return_exceptions=True)

    async def _run(self, peer: Peer) -> None:
        try:
            await peer.run()
        except Exception as error:
            # A fault with one peer must not end the others.
            self._metrics.faults.caught("peer", error, peer=peer.id)
        finally:
            del self._sessions[peer]
            self.ended += 1
            self._metrics.peers.labels(peer.role).dec()
            self._metrics.peers_ended.labels(peer.ended).inc()
            self._metrics.dropped.labels("channel").inc(peer.transport.lost)
            log.info("peer left", peer=peer.id, role=peer.role, name=peer.name, why=peer.ended)
