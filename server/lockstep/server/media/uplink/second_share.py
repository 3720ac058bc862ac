"""Decides whether a robot that encodes makes second encodings for observers, and with how many bits. No I/O.

| second encodings | when | then |
|---|---|---|
| off | observers were due 1.5 times the operator's bits for 5 s, and the uplink is known to have room | on |
| on | – | what the operator leaves of the bits that the uplink was known to carry at the beginning |
| on | that is less than 1.2 times the operator's, or nobody is due more | off |
| on | the uplink shows a limit, or no picture came for 3 s | off, and the wait for the next beginning doubles |

The uplink is known to have room when it showed no limit within the last minute, and carried 2.5 times the operator's
bits and a margin within that minute, without a queue. So nothing is tried out at the operator's expense. The wait is
10 s to 640 s.
"""

__all__ = ["SecondShare"]

WANTED_SECONDS = 5.0
WORTH, KEEP = 1.5, 1.2  # of the operator's bits: from which a second encoding begins, and down to which it goes on
MARGIN = 0.85  # of what the uplink carried without a queue, for both encodings together
PATIENCE, MOST_PATIENCE = 10.0, 640.0  # s
SILENCE = 3.0  # s


class SecondShare:
    """Call `decide` ten times a second, and `came` for each picture of a second encoding.

    Attributes:
        on: True while second encodings are made
    """

    def __init__(self) -> None:
        self.on = False
        self._wanted_since: float | None = None  # None: nobody is due more
        self._patience = PATIENCE
        self._not_before = float("-inf")  # s; time of the next beginning
        self._came = 0.0  # time of the newest picture, or of the beginning
        self._total = 0.0  # bits per second of both encodings together

    def came(self, now: float) -> None:
        """A picture of a second encoding arrived."""
        self._came = now

    def decide(self, now: float, *, first_bps: float, most_bps: float, shown_bps: float, limited: bool) -> float:
        """Return the bits per second of all second encodings together; 0 for none.

        Args:
            first_bps: of all first encodings
            most_bps: that observers can use; 0: nobody is due more than the operator's pictures
            shown_bps: that the uplink lately carried without a queue, without sound
            limited: the uplink has shown a limit within the last minute
        """
        if most_bps < WORTH * first_bps or most_bps <= 0:
            self._wanted_since, self.on = None, False
            return 0.0
        if self._wanted_since is None:
            self._wanted_since = now
        if self.on and (limited or now - self._came > SILENCE):
            self._fail(now)
        if not self.on:
            is_time = now >= self._not_before and now - self._wanted_since >= WANTED_SECONDS
            total = MARGIN * shown_bps
            if limited or not is_time or total - first_bps < WORTH * first_bps:
                return 0.0
            self.on, self._came, self._total = True, now, total
        room = self._total - first_bps
        if room < KEEP * first_bps:
            self.on = False
            return 0.0
        return min(most_bps, room)

    def _fail(self, now: float) -> None:
        self.on = False
        self._not_before = now + self._patience
        self._patience = min(MOST_PATIENCE, 2 * self._patience)
