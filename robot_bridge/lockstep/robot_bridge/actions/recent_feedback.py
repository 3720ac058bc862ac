"""Remembers the newest feedbacks, which requests for actions answer. No I/O, no clock: the caller hands in `now`."""

from collections import OrderedDict
from typing import NamedTuple

__all__ = ["RecentFeedback"]

MAX_NONCES = 1024  # of the newest feedbacks; a forgotten one counts as late


class _Seen(NamedTuple):
    time: float  # s, when the feedback was issued
    spell: int


class RecentFeedback:
    """Call `issued` with each feedback, and `void` when something happens that its reader could not know."""

    def __init__(self, max_age: float) -> None:
        """`max_age`: s for which a request may answer a feedback."""
        self._max_age = max_age
        self._nonces: OrderedDict[int, _Seen] = OrderedDict()  # oldest first
        self._spell = 1  # counts the causes that void requests of before

    def issued(self, nonce: int, now: float) -> None:
        self._nonces[nonce] = _Seen(now, self._spell)
        if len(self._nonces) > MAX_NONCES:
            self._nonces.popitem(last=False)

    def void(self) -> None:
        """Let no request for a motion begin that was decided before now."""
        self._spell += 1

    def forget(self) -> None:
        """Let no request begin at all that was decided before now."""
        self._nonces.clear()

    def is_answered_in_time(self, nonce: int, now: float, *, moves: bool) -> bool:
        """Return whether a request that arrived now may answer the feedback with this nonce."""
        seen = self._nonces.get(nonce)
        return seen is not None and now - seen.time <= self._max_age and (not moves or seen.spell == self._spell)
