"""The links that were given the key of the present publication. No I/O."""

from collections.abc import Callable, Collection
from typing import NamedTuple

from lockstep.server.auth.tokens import Identity

__all__ = ["KeyHolders"]

STRAY_SECONDS = 60.0  # then an observer with a key and no line to the console is thought to watch on without it
RENEW_SECONDS = 600.0  # between two publications because of such observers


class _Holder(NamedTuple):
    expires: float  # s since 1970
    seen_at: float  # last time that one of its peers was here


class KeyHolders:
    """Tells when the key has to become invalid. `now` is s on a monotonic clock.

    Args:
        has_ended: whether the link with this id and expiry is no longer valid
    """

    def __init__(self, has_ended: Callable[[str, float], bool]) -> None:
        self._has_ended = has_ended
        self._holders: dict[str, _Holder] = {}  # by link
        self._since = float("-inf")

    def begin(self, now: float) -> None:
        """Forget all: there is a new key."""
        self._holders.clear()
        self._since = now

    def add(self, identity: Identity, now: float) -> None:
        self._holders[identity.token_id] = _Holder(identity.expires, now)

    def any_has_ended(self) -> bool:
        """Return whether the link of a holder has ended."""
        return any(self._has_ended(link, each.expires) for link, each in self._holders.items())

    def has_strays(self, here: Collection[str], now: float) -> bool:
        """Return whether somebody may watch without taking part; False for `RENEW_SECONDS` after a new key.

        `here`: the links that watch through relays
        """
        for link in self._holders.keys() & here:
            self._holders[link] = self._holders[link]._replace(seen_at=now)
        gone = any(now - each.seen_at > STRAY_SECONDS for each in self._holders.values())
        return gone and now - self._since > RENEW_SECONDS
