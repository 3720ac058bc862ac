"""The time after which a peer that gets pictures and sends no feedback counts as silent (RFC 8083 asks for one)."""

__all__ = ["FeedbackTimeout"]

SECONDS = 2.0  # on top of a round trip
FIRST_SECONDS = 5.0  # likewise, before the first feedback; a browser takes its time to start


class FeedbackTimeout:
    """The timeout of one peer."""

    def __init__(self, now: float) -> None:
        self._seconds = FIRST_SECONDS
        self._since = now

    def restart(self, now: float) -> None:
        """Note that there is feedback."""
        self._seconds = SECONDS
        self._since = now

    def is_over(self, round_trip: float, now: float) -> bool:
        return now - self._since > self._seconds + round_trip
