"""The claims on the control seat: the peers that ask its holder for it. No I/O, no clock."""

from collections.abc import Iterator

from lockstep.server.control.seat.seat_table import SeatRefusal

__all__ = ["DECLINED_FOR", "MAX_CLAIMS", "Claims"]

MAX_CLAIMS = 8
DECLINED_FOR = 5.0  # s after a decline in which the same peer cannot claim again


class Claims:
    """The peers that ask for the seat, the longest waiting first."""

    def __init__(self, seconds: float) -> None:
        """`seconds`: until a claim counts as declined."""
        self._seconds = seconds
        self._deadlines: dict[str, float] = {}  # of each claim, oldest first
        self._declined: dict[str, float] = {}  # peer -> time from which it may claim again

    def __contains__(self, peer: str) -> bool:
        return peer in self._deadlines

    def __len__(self) -> int:
        return len(self._deadlines)

    def __iter__(self) -> Iterator[str]:
        return iter(self._deadlines)

    @property
    def first(self) -> str:
        """The peer that has waited longest; "": there is no claim."""
        return next(iter(self._deadlines), "")

    def ask(self, peer: str, now: float) -> SeatRefusal | None:
        """Add a claim. Return a refusal if `peer` may not claim now, else None."""
        self._declined = {each: until for each, until in self._declined.items() if until > now}
        if peer in self._declined:
            return SeatRefusal(peer, "declined", "ask again a little later")
        if len(self._deadlines) >= MAX_CLAIMS:
            return SeatRefusal(peer, "seat_taken", "too many people wait for the seat")
        self._deadlines[peer] = now + self._seconds
        return None

    def drop(self, peer: str) -> None:
        """Remove the claim of `peer`, if there is one."""
        self._deadlines.pop(peer, None)

    def decline(self, peer: str, now: float) -> None:
        """Remove the claim of `peer`, which may not ask again for a while."""
        self.drop(peer)
        self._declined[peer] = now + DECLINED_FOR

    def gone(self, peer: str) -> None:
        """Forget that `peer`, which has left, was declined."""
        self._declined.pop(peer, None)

    def seconds_left(self, now: float) -> dict[str, float]:
        """Return the peers that ask, with the seconds left to each."""
        return {peer: max(0.0, deadline - now) for peer, deadline in self._deadlines.items()}

    def unanswered(self, now: float) -> list[str]:
        """Return the peers whose time is over."""
        return [peer for peer, deadline in self._deadlines.items() if now >= deadline]
