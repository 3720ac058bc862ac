"""Links that other consoles revoked, in memory and on disk."""

from collections.abc import Mapping

import msgspec

from lockstep.server.util.state_dir import StateDamaged, StateDir

__all__ = ["ELSEWHERE", "RevokedElsewhere"]

ELSEWHERE = "revoked-elsewhere.json"
MAX_ELSEWHERE = 5000  # links; those that would end first are forgotten first


class _Elsewhere(msgspec.Struct, frozen=True):
    revoked: dict[str, float] = {}  # id of a link: when it would have expired


_elsewhere = msgspec.json.Decoder(_Elsewhere)


class RevokedElsewhere:
    """The ids of the links, with the time when each would have expired, s since 1970.

    Raises:
        StateDirUnusable, StateDamaged: the file cannot be read or decoded.
    """

    def __init__(self, directory: StateDir) -> None:
        self._directory = directory
        self.links: Mapping[str, float] = self._read()

    def __contains__(self, link: str) -> bool:
        return link in self.links

    def add(self, links: Mapping[str, float]) -> bool:
        """Add links, in memory; True if any of them is new."""
        fresh = {link: expires for link, expires in links.items() if link not in self.links}
        if fresh:
            self.links = _newest({**self.links, **fresh})
        return bool(fresh)

    def write(self, now: float) -> Mapping[str, float]:
        """Write those that have not expired at `now`, other processes' too, and return them.

        Call it with the directory locked. Blocks.
        """
        known = {**self._read(), **self.links}
        kept = _newest({link: expires for link, expires in known.items() if expires > now})
        self._directory.write(ELSEWHERE, msgspec.json.encode(_Elsewhere(kept)))
        return kept

    def _read(self) -> dict[str, float]:
        data = self._directory.read(ELSEWHERE)
        try:
            return {} if data is None else _elsewhere.decode(data).revoked
        except (msgspec.DecodeError, UnicodeError, RecursionError) as error:
            raise StateDamaged(self._directory.path / ELSEWHERE, f"the file is damaged: {error}") from error


def _newest(links: dict[str, float]) -> dict[str, float]:
    return dict(sorted(links.items(), key=lambda item: item[1], reverse=True)[:MAX_ELSEWHERE])
