"""Decides which repeats of an executed command are answered. No I/O, no clock.

A console that misses packets sends its commands several times, and each answer is a whole feedback. On a path that
queues packets, the answers would lengthen the queue in which the first of them waits, and cause more repeats: so only
one of them goes at a time. On a path that merely loses packets, all of them go.
"""

__all__ = ["SPACING", "RepeatReplyLimiter"]

SPACING = 0.25  # s between two such answers over a path that queues


class RepeatReplyLimiter:
    """Limits the answers to one peer."""

    def __init__(self) -> None:
        self._answered_at = float("-inf")

    def allows(self, now: float, *, queues: bool) -> bool:
        """Return whether to answer a repeat now; if so, count it. `queues`: packets wait on the peer's path, or did."""
        if queues and now - self._answered_at < SPACING:
            return False
        self._answered_at = now
        return True
