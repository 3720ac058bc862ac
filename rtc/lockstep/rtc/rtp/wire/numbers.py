"""Sequence numbers and timestamps that wrap."""

__all__ = ["Unwrapper", "is_after"]


def is_after(one: int, other: int, bits: int = 16) -> bool:
    """True if the wrapping number `one` is ahead of `other`, as far as that can be told (RFC 1982 3.2)."""
    return one != other and (one - other) % (1 << bits) < 1 << (bits - 1)


class Unwrapper:
    """Turns wrapping numbers into ones that do not wrap; the first one is itself."""

    def __init__(self, bits: int = 16) -> None:
        self._size = 1 << bits
        self._newest: int | None = None

    def unwrap(self, number: int) -> int:
        """Return the value of `number` nearest to the newest before it; negative when older than the first."""
        if self._newest is None:
            self._newest = number
            return number
        ahead = (number - self._newest) % self._size
        found = self._newest + (ahead if ahead < self._size // 2 else ahead - self._size)
        self._newest = max(self._newest, found)
        return found
