"""The issues of the current event that the console knows, with their nonces. No I/O."""

from lockstep.protocol.messages import Feedback

__all__ = ["KnownIssues"]

KNOWN_ISSUES = 64  # of the current event; at two a second the oldest was issued long before any `max_event_age`


class KnownIssues:
    """Call `add` with each feedback that the event clock accepted, and `clear` when an epoch ends."""

    def __init__(self) -> None:
        self._nonces: dict[int, int] = {}  # issue of the current event -> its nonce, oldest first
        self._event = 0  # event of these nonces; 0 before the first feedback

    def add(self, feedback: Feedback) -> None:
        if feedback.event != self._event:
            self._nonces.clear()
        self._event = feedback.event
        self._nonces[feedback.issue] = feedback.nonce
        if len(self._nonces) > KNOWN_ISSUES:
            del self._nonces[next(iter(self._nonces))]

    def nonce(self, issue: int) -> int | None:
        """Return the nonce of an issue; None: the console does not know the issue."""
        return self._nonces.get(issue)

    def clear(self) -> None:
        self._nonces.clear()
