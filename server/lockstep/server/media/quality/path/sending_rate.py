"""The bit rate at which pictures leave for a peer. No clock is read here."""

__all__ = ["SendingRate"]

LEAST_SECONDS = 0.05  # between two measurements
AVERAGED_SECONDS = 0.7


class SendingRate:
    """A moving average over the last second or so."""

    def __init__(self) -> None:
        self.bps = 0.0
        self._before: tuple[int, float] | None = None  # total octets, and the time

    def add(self, octets: int, now: float) -> None:
        """Take the total number of bytes of pictures that have been sent."""
        if self._before is None:
            self._before = octets, now
            return
        passed = now - self._before[1]
        if passed < LEAST_SECONDS:
            return
        rate = max(0, octets - self._before[0]) * 8 / passed
        self.bps += (rate - self.bps) * min(1.0, passed / AVERAGED_SECONDS)
        self._before = octets, now
