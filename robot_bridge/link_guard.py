"""Who has failed to prove the link's secret too often. No I/O, no clock.

The secret is too long to be guessed; the guard keeps somebody who tries from keeping the bridge busy.
"""

__all__ = ["LinkGuard"]

TRIES = 5  # at once
REFILL = 2.0  # s for another one
MAX_ADDRESSES = 256


class LinkGuard:
    """One budget of failures for each address; the addresses that failed longest ago are forgotten."""

    def __init__(self) -> None:
        self._spent: dict[str, tuple[float, float]] = {}  # address -> tries spent, when; {"10.0.0.9": (2.5, 103.2)}

    def failed(self, address: str, now: float) -> None:
        spent = self._left_over(address, now) + 1.0
        self._spent.pop(address, None)
        self._spent[address] = (min(spent, float(TRIES)), now)
        if len(self._spent) > MAX_ADDRESSES:
            del self._spent[next(iter(self._spent))]

    def succeeded(self, address: str) -> None:
        """It knows the secret: what failed before is forgiven."""
        self._spent.pop(address, None)

    def is_blocked(self, address: str, now: float) -> bool:
        """Whether it has to wait."""
        return self._left_over(address, now) > TRIES - 1

    def _left_over(self, address: str, now: float) -> float:
        spent, since = self._spent.get(address, (0.0, now))
        return max(0.0, spent - (now - since) / REFILL)
