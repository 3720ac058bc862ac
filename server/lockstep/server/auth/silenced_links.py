"""Links whose stops a supervisor has silenced, and all invited with them. No I/O, no clock: `now` is passed in.

A person who may invite could go on with a link that they made themselves. So silence covers a link and every link below
it: those that were invited with it, with those, and so on, before or after it was silenced.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping

__all__ = ["MAX_SILENCED", "SILENCE_SECONDS", "SilencedLinks"]

SILENCE_SECONDS = 600.0  # after which it ends automatically
MAX_SILENCED = 256  # links; one more ends the silence of the oldest
MAX_CONSOLES = 64  # other consoles that tell their silences, which end automatically too
MAX_ABOVE = 5000  # links above one another, as many as are ever remembered
CLOCK_SLACK = 2.0  # s by which two consoles may differ about the end of one silence


def _nobody(link: str) -> str:
    return ""


class SilencedLinks:
    """The silenced links of one console, for all its robots.

    Args:
        invited_with: returns the link that a link was invited with; "" if there was none, or that is unknown
    """

    def __init__(self, invited_with: Callable[[str], str] = _nobody) -> None:
        self._invited_with = invited_with
        self._until: dict[str, float] = {}  # link -> s, oldest first
        self._elsewhere: dict[str, dict[str, float]] = {}  # console -> what it silenced, as `_until`
        self._heard: dict[str, float] = {}  # link -> s, until when its silence elsewhere does not count here

    def __len__(self) -> int:
        return len(self._until)

    def silence(self, link: str, now: float) -> None:
        self._until.pop(link, None)
        self._heard.pop(link, None)
        self._until[link] = now + SILENCE_SECONDS
        while len(self._until) > MAX_SILENCED:
            del self._until[next(iter(self._until))]

    def hear(self, link: str, now: float) -> bool:
        """End every silence that covers this link, also of a link above it; True if there was any."""
        found = [each for each in self._above(link) if self._end_of(each) > now]
        for each in found:
            self._until.pop(each, None)
            if (end := self._end_of(each)) > now:
                self._heard[each] = end + CLOCK_SLACK
        self._heard = {each: until for each, until in self._heard.items() if until > now}
        return bool(found)

    def holds(self, link: str, now: float) -> bool:
        return self._covered_until(link) > now

    def ended(self, now: float) -> list[str]:
        """Remove the silences that have run out; return their links."""
        over = [link for link, until in self._until.items() if now >= until]
        for link in over:
            del self._until[link]
        return over

    # other consoles

    def told_elsewhere(self, console: str, links: Mapping[str, float], now: float) -> None:
        """Set the links that another console has silenced now, and until when, in place of those it told before."""
        self._elsewhere.pop(console, None)
        latest = now + SILENCE_SECONDS + CLOCK_SLACK
        wanted = {link: min(until, latest) for link, until in links.items() if until > now}
        if not wanted:
            return
        self._elsewhere[console] = dict(list(wanted.items())[:MAX_SILENCED])
        while len(self._elsewhere) > MAX_CONSOLES:
            del self._elsewhere[next(iter(self._elsewhere))]

    def to_tell(self, known: Iterable[str], now: float) -> dict[str, float]:
        """Return at most `MAX_SILENCED` links silenced here, for other consoles.

        `known`: all links that were invited here; others do not know which was invited with which.
        """
        found = {link: until for link, until in self._until.items() if until > now}
        if found or self._elsewhere:
            below = ((link, self._covered_until(self._invited_with(link))) for link in known)
            found.update((link, until) for link, until in below if until > max(now, found.get(link, 0.0)))
        return dict(list(found.items())[:MAX_SILENCED])

    def _covered_until(self, link: str) -> float:
        """Return the end of the silence that covers the link; 0 if it is not silenced."""
        if not (self._until or self._elsewhere) or not link:
            return 0.0
        return max(map(self._end_of, self._above(link)))

    def _end_of(self, link: str) -> float:
        """Return the end of the silence of this very link; 0 if it is not silenced."""
        elsewhere = max((links.get(link, 0.0) for links in self._elsewhere.values()), default=0.0)
        if elsewhere <= self._heard.get(link, 0.0):
            elsewhere = 0.0
        return max(self._until.get(link, 0.0), elsewhere)

    def _above(self, link: str) -> Iterator[str]:
        """Yield the link, the one that it was invited with, and so on."""
        for _ in range(MAX_ABOVE):
            yield link
            link = self._invited_with(link)
            if not link:
                return
