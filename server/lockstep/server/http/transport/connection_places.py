"""Decides which connections get a place. If all are taken, a stranger loses one, never the newcomer. No I/O.

A connection is a stranger's until a request on it has brought a good token. Every connection begins as one, so if the
console refused strangers, a client that comes to send STOP would be refused with them. For the same reason a new
connection keeps its place for a moment, in which it can send its request; newcomers wait meanwhile.
"""

from collections.abc import Callable

from lockstep.server.http.limit_settings import LimitSettings

__all__ = ["GRACE", "ConnectionPlaces", "Place"]

GRACE = 0.25  # s; a busy proxy has opened a connection well before it writes the request to it


class Place:
    """The place of one connection. It may be given back, or be taken away: then `close` is called."""

    __slots__ = ("address", "asked", "close", "group", "link", "refused", "since")

    def __init__(self, address: str, close: Callable[[], None], since: float) -> None:
        self.address = address  # as it is counted
        self.since = since
        self.asked = False  # True once a request came on it
        self.link = ""  # link of the newest request's good token; "": a stranger's
        self.refused = 0  # requests in a row that were turned away
        self.close = close
        self.group: dict[Place, None] | None = None  # the group that counts it; None: not counted any more


class ConnectionPlaces:
    """Gives places to connections. `on_refused` gets a stable name to count for each one that has to go."""

    def __init__(self, total: int, per_client: int, on_refused: Callable[[str], None]) -> None:
        """`per_client`: bound for one address, and for one link."""
        self.on_refused = on_refused
        self._total = total
        self._per_client = per_client
        self._count = 0
        self._strangers: dict[str, dict[Place, None]] = {}  # by address, each the oldest first
        self._known: dict[str, dict[Place, None]] = {}  # by link

    @classmethod
    def within(cls, settings: LimitSettings, on_refused: Callable[[str], None]) -> "ConnectionPlaces":
        return cls(settings.max_connections, settings.max_address_connections, on_refused)

    def __len__(self) -> int:
        return self._count

    @property
    def known(self) -> int:
        """Connections whose newest request brought a good token."""
        return sum(map(len, self._known.values()))

    def wait(self, now: float) -> float:
        """Return how long (s) a newcomer has to wait: as long as the next to go has had no time to send a request.

        0 if there is room, or if the next to go has sent a request or been silent for `GRACE`.
        """
        oldest = self._oldest() if self._count >= self._total else None
        return 0.0 if oldest is None or oldest.asked else max(0.0, oldest.since + GRACE - now)

    def enter(self, address: str, close: Callable[[], None], now: float, *, proxy: bool = False) -> Place:
        """Add a stranger's new connection. `proxy`: many clients come from this address; it tells them apart later."""
        place = Place(address, close, now)
        self._count += 1
        self._join(place, bounded=not proxy)
        if self._count > self._total:
            self._make_room(place)
        return place

    def serve(self, place: Place, address: str, link: str) -> bool:
        """Note that a request came on it, from this address, with a good token of this link ("": without one).

        False if its place was taken away meanwhile.
        """
        if place.group is None:
            return False
        place.asked = True
        if (place.address, place.link) != (address, link):
            self._drop(place)
            place.address, place.link = address, link
            self._join(place, bounded=True)
        return True

    def leave(self, place: Place) -> None:
        """Give a place back. Idempotent."""
        if place.group is not None:
            self._drop(place)
            self._count -= 1

    def _join(self, place: Place, *, bounded: bool) -> None:
        groups, key = (self._known, place.link) if place.link else (self._strangers, place.address)
        group = groups.setdefault(key, {})
        group[place] = None
        place.group = group
        if bounded and len(group) > self._per_client:
            self._take_away(next(iter(group)))

    def _drop(self, place: Place) -> None:
        group = place.group
        if group is not None:
            del group[place]
            place.group = None
            groups, key = (self._known, place.link) if place.link else (self._strangers, place.address)
            if not group:
                groups.pop(key, None)

    def _make_room(self, newcomer: Place) -> None:
        self._take_away(self._oldest(newcomer) or newcomer)

    def _oldest(self, newcomer: Place | None = None) -> Place | None:
        """Return the oldest place of the stranger, or else the link, with most; None if there is only the newcomer."""
        for groups in (self._strangers, self._known):
            most = max(groups.values(), key=len, default={})
            oldest = next(iter(most), newcomer)
            if oldest is not newcomer:
                return oldest
        return None

    def _take_away(self, place: Place) -> None:
        self.leave(place)
        self.on_refused("too_many_connections")
        place.close()
