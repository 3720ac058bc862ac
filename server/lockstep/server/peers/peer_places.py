"""Decides which peers get a place, and keeps the places of those that are being negotiated. No I/O."""

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from typing import Protocol

from lockstep.protocol.console import Role
from lockstep.server.auth.tokens import Identity
from lockstep.server.errors import ShuttingDown, TooManyPeers, TooManyRequests
from lockstep.server.peers.liveness import Liveness

__all__ = ["RESERVED_FOR_LINK", "PeerPlaceLimits", "PeerPlaces", "check_place"]

LINK_SHARE = 3, 4  # share of the observers' places that one link may have
RESERVED_FOR_LINK = 2  # of the last places one link may have these: a page, and a program or another page


class PeerPlaceLimits(Protocol):
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


class PlacedPeer(Protocol):
    """The part of a peer that its place depends on."""

    @property
    def identity(self) -> Identity: ...
    @property
    def relay(self) -> str: ...
    @property
    def thumbnail(self) -> bool: ...
    @property
    def liveness(self) -> Liveness: ...


class PeerPlaces:
    """The places of the peers that are here, and of those that are being negotiated."""

    def __init__(
        self,
        limits: PeerPlaceLimits,
        peers: Collection[PlacedPeer],
        further_bounds: Sequence[Callable[[Identity], None]] = (),
    ) -> None:
        """`peers`: a view of those that are here.

        `further_bounds`: each raises TooManyPeers where there is no place for one more peer of this identity.
        """
        self.closed = False
        self._limits = limits
        self._peers = peers
        self._further_bounds = further_bounds
        self._kept: Counter[str] = Counter()  # places of peers that are being negotiated, by token

    @property
    def taken(self) -> int:
        """Places of peers that get media from here, and of peers that are being negotiated."""
        return sum(not peer.relay for peer in self._peers) + self._kept.total()

    def taken_by(self, token_id: str) -> int:
        """Return the number of `taken` places that one link has."""
        here = sum(not peer.relay and peer.identity.token_id == token_id for peer in self._peers)
        return here + self._kept[token_id]

    def close(self) -> None:
        """Give no more places."""
        self.closed = True

    @contextmanager
    def keep(self, identity: Identity, *, relayed: bool = False, thumbnail: bool = False) -> Iterator[None]:
        """Keep a place while a peer is being negotiated; `check_place` decides which peers get a place.

        `relayed`: the peer gets its media from a relay. Such peers cost little and are counted separately, as are peers
        that get a `thumbnail`.

        Raises:
            TooManyPeers: there is no place for this link.
            TooManyRequests: too many peers of this link have not connected yet.
            ShuttingDown: the console is shutting down.
        """
        if self.closed:
            raise ShuttingDown("the console is shutting down")
        limits, token_id = self._limits, identity.token_id
        bound = limits.max_relayed if relayed else limits.max_thumbnails if thumbnail else limits.max_peers
        alike = [peer for peer in self._peers if (bool(peer.relay), peer.thumbnail) == (relayed, thumbnail)]
        held = sum(peer.identity.token_id == token_id for peer in alike) + self._kept[token_id]
        taken = len(alike) + self._kept.total()
        check_place(identity.role, held, taken, bound, 0 if thumbnail else limits.reserved_places)
        for check in () if relayed else self._further_bounds:
            check(identity)
        waiting = sum(peer.identity.token_id == token_id and not peer.liveness.connected for peer in self._peers)
        if waiting + self._kept[token_id] >= limits.max_unconnected:
            raise TooManyRequests(f"{limits.max_unconnected} peers of this link have not connected yet")
        self._kept[token_id] += 1
        try:
            yield
        finally:
            self._kept[token_id] -= 1
            if self._kept[token_id] == 0:
                del self._kept[token_id]


def check_place(role: Role, held: int, taken: int, bound: int, reserved: int) -> None:
    """Raise TooManyPeers unless there is a place for one more peer.

    The last `reserved` places are for people who may drive, and one of them is for a supervisor. One link cannot take
    all.

    Args:
        held: places that the peer's link has already, at most `taken`
        taken: places that all links have already
        bound: number of places
    """
    usual = max(1, bound - reserved)
    limit = usual if role in ("observer", "policy") else bound - 1 if role == "operator" and reserved > 1 else bound
    if taken >= limit:
        raise TooManyPeers(f"all {limit} places are taken")
    share = -(-usual * LINK_SHARE[0] // LINK_SHARE[1])
    if held >= share:
        raise TooManyPeers(f"this link has all of its {share} of the {bound} places; use another link")
    if taken >= usual and held >= RESERVED_FOR_LINK:
        raise TooManyPeers(f"the last {reserved} places are for links with fewer than {RESERVED_FOR_LINK}")
