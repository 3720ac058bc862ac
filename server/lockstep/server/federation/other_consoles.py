"""Tracks the other consoles: their signs of life, their states and name conflicts. No I/O, no clock."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace

from lockstep.server.federation.board import Conflict
from lockstep.server.federation.messages import Published
from lockstep.server.federation.robot_summary import Tile

__all__ = ["GONE_AFTER", "MAX_CONSOLES", "UNKNOWN_AFTER", "OtherConsoles"]

MAX_CONSOLES = 64
UNKNOWN_AFTER = 3.0  # s without a sign of life
GONE_AFTER = 60.0
LIVES_AFTER = 2  # signs of life; a state that is only found in the store may be left over from a run that ended

NOT_HEARD = "its console is silent"


@dataclass
class _Other:
    shown: Published
    heard_at: float
    signs: int = 1  # signs of life

    def lives(self, now: float) -> bool:
        return self.signs >= LIVES_AFTER and not self.silent(now)

    def silent(self, now: float) -> bool:
        return now - self.heard_at > UNKNOWN_AFTER


class OtherConsoles:
    """`now` is monotonic. A console lives while the number of its state goes up: no clocks are compared."""

    def __init__(self, own_id: str, own_name: str) -> None:
        self._own_id = own_id
        self._own_name = own_name
        self._others: dict[str, _Other] = {}

    def heard(self, published: Published, now: float) -> bool:
        """Take the state of a console. Return False if it is not new, or there are too many consoles."""
        if published.id == self._own_id:
            return False
        known = self._others.get(published.id)
        if known is None:
            self._forget(now)
            if len(self._others) >= MAX_CONSOLES:
                return False
            self._others[published.id] = _Other(published, now)
            return True
        if published.n <= known.shown.n:
            return False
        known.shown, known.heard_at, known.signs = published, now, known.signs + 1
        return True

    def gone(self, console: str) -> None:
        """Forget a console that said goodbye."""
        self._others.pop(console, None)

    def name(self, console: str) -> str:
        """Return the name for people; the id of an unknown console."""
        known = self._others.get(console)
        return console if known is None else known.shown.name

    def living(self, now: float) -> int:
        return sum(other.lives(now) for other in self._others.values())

    def owners(self, robots: Collection[str], now: float) -> dict[str, str]:
        """Return the names of the consoles that have these robots, as far as known, by robot."""
        return {tile.name: other.shown.name for other, tile in self._tiles(now) if tile.name in robots}

    def tiles(self, own: Collection[str], now: float) -> list[Tile]:
        """Return one tile for each name that is not in `own`: that of a living console, if there is one."""
        self._forget(now)
        found: dict[str, Tile] = {}
        for other, tile in self._tiles(now):
            if tile.name not in own:
                found.setdefault(tile.name, _seen(tile, other, now))
        return sorted(found.values(), key=lambda tile: tile.name)

    def conflicts(self, own: Collection[str], now: float) -> tuple[Conflict, ...]:
        claims: dict[str, list[str]] = {name: [self._own_name] for name in own}
        for other in self._others.values():
            if other.lives(now):
                for name in {tile.name for tile in other.shown.robots}:
                    claims.setdefault(name, []).append(other.shown.name)
        return tuple(
            Conflict(robot=robot, consoles=tuple(sorted(names)))
            for robot, names in sorted(claims.items())
            if len(names) > 1
        )

    def _tiles(self, now: float) -> Iterator[tuple[_Other, Tile]]:
        """Yield the living first, then always in the same order, so that a conflict does not flicker."""
        for _, other in sorted(self._others.items(), key=lambda item: (item[1].silent(now), item[0])):
            for tile in other.shown.robots:
                yield other, tile

    def _forget(self, now: float) -> None:
        self._others = {key: other for key, other in self._others.items() if now - other.heard_at <= GONE_AFTER}


def _seen(tile: Tile, other: _Other, now: float) -> Tile:
    """Return the tile as of now, not as of the time when it was published."""
    age_ms = (now - other.heard_at) * 1000
    feedback_age_ms = None if tile.feedback_age_ms is None else round(tile.feedback_age_ms + age_ms, 1)
    if other.silent(now):
        return replace(
            tile,
            link="unknown",
            detail=NOT_HEARD,
            link_age_ms=round(age_ms, 1),
            feedback_age_ms=feedback_age_ms,
            event_rate=0.0,
            console=other.shown.name,
        )
    link_age_ms = None if tile.link_age_ms is None else round(tile.link_age_ms + age_ms, 1)
    return replace(tile, link_age_ms=link_age_ms, feedback_age_ms=feedback_age_ms, console=other.shown.name)
