"""Decides whether a robot that encodes makes second encodings for observers, and with how many bits. No I/O.

| second encodings | when | then |
|---|---|---|
| off | observers were due half as many bits again as the operator's, or more, for 5 s; no limit for a minute | on |
| on | the uplink has shown no limit | what is left of its rate, at least one and a half times the operator's |
| on | it has shown one | what is left of the limit, and off if that is not more than 1.2 times the operator's |
| on | nobody is due more, or no picture came for 3 s | off |

A trial that ends by a limit doubles the wait for the next: 10 s to 640 s. The operator's share never depends on this.
"""

__all__ = ["SecondShare"]

WANTED_SECONDS = 5.0
WORTH, KEEP = 1.5, 1.2  # of the operator's bits: from which a second encoding begins, and down to which it goes on
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
        self._not_before = float("-inf")  # s; time of the next trial
        self._came = 0.0  # time of the newest picture, or of the beginning

    def came(self, now: float) -> None:
        """A picture of a second encoding arrived."""
        self._came = now

    def decide(self, now: float, *, first_bps: float, most_bps: float, rate_bps: float, limited: bool) -> float:
        """Return the bits per second of all second encodings together; 0 for none.

        Args:
            first_bps: of all first encodings
            most_bps: that observers can use; 0: nobody is due more than the operator's pictures
            rate_bps: of the uplink without sound; while it is `limited`, no more than it has carried
            limited: the uplink has shown a limit within the last minute
        """
        if most_bps < WORTH * first_bps or most_bps <= 0:
            self._wanted_since, self.on = None, False
            return 0.0
        if self._wanted_since is None:
            self._wanted_since = now
        if not self.on:
            if limited or now < self._not_before or now - self._wanted_since < WANTED_SECONDS:
                return 0.0
            self.on, self._came = True, now
        room = rate_bps - first_bps
        if (limited and room < KEEP * first_bps) or now - self._came > SILENCE:
            self.on = False
            self._not_before = now + self._patience
            self._patience = min(MOST_PATIENCE, 2 * self._patience)
            return 0.0
        return min(most_bps, room if limited else max(room, WORTH * first_bps))
