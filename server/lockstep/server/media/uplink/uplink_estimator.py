"""Estimates how many bits per second a robot's uplink carries, from the ages at which its media arrive. No I/O.

The robot link is TCP: nothing is lost, but what the path does not carry waits, and arrives old. The clocks of both
sides differ by an unknown offset; the medium that waited least shows it.

| sign | rate |
|---|---|
| all media of half a second waited for more than 0.12 s | 85 % of what arrived, less until the queue is empty |
| some medium waited for less than 0.05 s, and the rate is used | up by 35 % a second, beyond the last limit by 8 % |
"""

from collections import deque
from statistics import median

from lockstep.server.media.uplink.least_age import LeastAge

__all__ = ["UplinkEstimator"]

LOOK_SECONDS = 0.5  # for a standing queue
RATE_SECONDS = 1.0  # over which the arriving bits are counted
PICTURE_SECONDS = 1.0  # of the operator's pictures whose median wait is told
MOST_ARRIVALS = 2000
LEAST_SPAN = 0.1  # s between arrivals from which a rate can be told
STANDING, EMPTY = 0.12, 0.05  # s that the least delayed medium waited
CUT, DEEPEST = 0.85, 0.5
FAST, SLOW = 1.35, 1.08  # a second
USED = 0.75  # of the rate
HOLD = 0.5  # s after a decrease, besides the time that media waited
HEADER = 180  # bytes of a message besides its payload, TCP's and IP's share included
LIMITED_SECONDS = 60.0  # a path that was once too full counts as limited for so long
SHOWN_SECONDS = 60.0  # for which it is known what the path carried without a queue
WHOLE_SPAN = 0.8  # s between arrivals from which a rate counts as carried: a burst alone shows nothing


class UplinkEstimator:
    """Call `arrived` for every medium, and `decide` ten times a second.

    Attributes:
        rate: bits per second that all media of the robot may have together
        limited_at: time of the last decrease, s; minus infinity before the first
    """

    def __init__(self, start_bps: float, least_bps: float, most_bps: float) -> None:
        self.rate = start_bps
        self.limited_at = float("-inf")
        self._least_bps = least_bps
        self._most_bps = most_bps
        self._base = LeastAge()  # of all media
        self._arrivals: deque[tuple[float, float, int]] = deque()  # time, wait in s, bits
        self._camera_bases: dict[str, LeastAge] = {}  # a camera's encoder takes its own time
        self._pictures: deque[tuple[float, float]] = deque(maxlen=MOST_ARRIVALS)  # time, wait in s
        self._hold_until = 0.0
        self._decided_at: float | None = None
        self._limit = float("inf")  # bits per second that the path carried then, and a margin off
        self._shown: deque[tuple[float, float]] = deque()  # time, bits per second; later ones are lower

    def arrived(self, captured: float, now: float, size: int, camera: str | None = None) -> None:
        """Take a medium of `size` bytes, captured at `captured` by the robot's clock.

        `camera`: whose picture for the operator it is; None for all other media.
        """
        age = now - captured
        self._arrivals.append((now, self._base.wait(age, now), 8 * (size + HEADER)))
        while len(self._arrivals) > MOST_ARRIVALS or now - self._arrivals[0][0] > RATE_SECONDS:
            self._arrivals.popleft()
        if camera is not None:
            self._pictures.append((now, self._camera_bases.setdefault(camera, LeastAge()).wait(age, now)))

    def limited(self, now: float) -> bool:
        """Return whether media waited on the path within the last minute."""
        return now - self.limited_at < LIMITED_SECONDS

    def shown(self, now: float) -> float:
        """Return the most bits per second that arrived without a queue in the last minute, since the last limit."""
        while self._shown and now - self._shown[0][0] > SHOWN_SECONDS:
            self._shown.popleft()
        return self._shown[0][1] if self._shown else 0.0

    def carried(self) -> float:
        """Return the bits per second that arrived in the last second; 0 if too few media came to tell."""
        return self._received() or 0.0

    def waits(self, now: float) -> float | None:
        """Return the wait of the medium that waited least of the last half second, s; None without two media."""
        waits = [wait for time, wait, _ in self._arrivals if now - time <= LOOK_SECONDS]
        return min(waits) if len(waits) >= 2 else None

    def pictures_wait(self, now: float) -> float | None:
        """Return the median wait of the operator's pictures of the last second, s; None without two of them.

        It shows a queue that comes and goes several times a second, which the least wait does not.
        """
        while self._pictures and now - self._pictures[0][0] > PICTURE_SECONDS:
            self._pictures.popleft()
        return median(wait for _, wait in self._pictures) if len(self._pictures) >= 2 else None

    def decide(self, now: float) -> None:
        """Adapt the rate."""
        passed = 0.0 if self._decided_at is None else min(1.0, now - self._decided_at)
        self._decided_at = now
        waits = self.waits(now)
        if waits is None or now < self._hold_until:
            return
        received = self._received()
        if waits > STANDING:
            carried = self.rate if received is None else min(self.rate, received)
            self._limit = max(self._least_bps, CUT * carried)
            self.rate = max(self._least_bps, DEEPEST * self.rate, self._limit * (1 - min(DEEPEST, waits)))
            self._hold_until = now + HOLD + waits
            self.limited_at = now
            self._shown.clear()
        elif waits < EMPTY and received is not None:
            self._show(now, received)
            if received >= USED * self.rate:
                growth = FAST if self.rate < self._limit else SLOW
                self.rate *= growth**passed
        self.rate = min(self.rate, self._most_bps)

    def _show(self, now: float, received: float) -> None:
        """Note that the path carried so much with no queue at the end of it."""
        if self._arrivals[-1][0] - self._arrivals[0][0] < WHOLE_SPAN:
            return
        while self._shown and self._shown[-1][1] <= received:
            self._shown.pop()
        self._shown.append((now, received))

    def _received(self) -> float | None:
        """Return the bits per second that arrived lately; None if too few came to tell."""
        if len(self._arrivals) < 2:
            return None
        span = self._arrivals[-1][0] - self._arrivals[0][0]
        if span < LEAST_SPAN:
            return None
        return (sum(bits for _, _, bits in self._arrivals) - self._arrivals[0][2]) / span
