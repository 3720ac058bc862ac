"""Links whose stops a supervisor has silenced. No I/O, no clock: `now` is handed in."""

__all__ = ["SILENCE_SECONDS", "SilencedLinks"]

SILENCE_SECONDS = 600.0  # then it ends by itself
MAX_SILENCED = 256  # links; one more ends the silence of the oldest


class SilencedLinks:
    def __init__(self) -> None:
        self._until: dict[str, float] = {}  # link -> s, oldest first

    def __len__(self) -> int:
        return len(self._until)

    def silence(self, link: str, now: float) -> None:
        self._until.pop(link, None)
        self._until[link] = now + SILENCE_SECONDS
        while len(self._until) > MAX_SILENCED:
            del self._until[next(iter(self._until))]

    def hear(self, link: str) -> bool:
        """Ends it; whether the link was silenced."""
        return self._until.pop(link, None) is not None

    def holds(self, link: str, now: float) -> bool:
        return now < self._until.get(link, now)

    def ended(self, now: float) -> list[str]:
        """Links whose silence has just run out."""
        over = [link for link, until in self._until.items() if now >= until]
        for link in over:
            del self._until[link]
        return over
