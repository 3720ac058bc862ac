"""One direction of a path for a byte stream that must arrive whole and in order: TCP as its user meets it. No I/O.

A lost packet does not go missing, it comes late: by one round trip if later packets make the receiver notice (fast
retransmit), by the retransmission timer if it was among the last (RFC 6298, with the usual floor of 0.2 s), and by
twice the timer for each further loss. The sending rate is not reduced as congestion control would.
"""

import math
from random import Random

from lockstep.emulator.impairment.bottleneck import Bottleneck
from lockstep.emulator.impairment.impairment import Impairment, Wander
from lockstep.emulator.impairment.outages import Outages, Silence
from lockstep.emulator.impairment.path import PathStatistics

__all__ = ["StreamPath"]

SEGMENT = 1448  # bytes that a TCP packet carries on an Ethernet
FAST_RETRANSMIT = 4  # packets in a message, from which on the others report a loss
MIN_TIMEOUT = 0.2  # s
MAX_TIMEOUT = 60.0  # s
MAX_RETRIES = 15


class StreamPath:
    """One direction of a stream. Call `admit` for every message, in order. Arguments as for an `ImpairedPath`.

    Args:
        back: seconds that the acknowledgements take on average; with the path's own delay, the round trip
    """

    def __init__(
        self,
        impairment: Impairment,
        seed: str,
        *,
        back: float = 0.0,
        bottleneck: Bottleneck | None = None,
        outages: Outages | None = None,
    ) -> None:
        self.impairment = impairment
        self.statistics = PathStatistics()
        self._back = back
        self._random = Random(seed)
        self._wander = Wander(Random(f"{seed} wander"))
        self._bottleneck = bottleneck
        self._outages = outages
        self._last = 0.0

    def admit(self, now: float, size: int) -> float:
        """Return the time at which the whole message has arrived."""
        share, fate = self._random.random(), self._random.random()
        counts = self.statistics
        counts.offered += 1
        retries = self._retries(size, fate)
        counts.lost += retries
        leaves = now
        if self._bottleneck is not None:
            leaves = self._bottleneck.admit(now, size) or now  # its queue is endless: TCP waits instead of dropping
        silence = None if self._outages is None else self._outages.at(now)
        if silence is not None:
            counts.held += 1
            leaves = max(leaves, self._after(silence, now))
        arrives = leaves + self._delay(leaves, share) + self._recovery(size, retries)
        self._last = max(arrives, self._last)
        counts.passed += 1
        counts.bytes += size
        counts.total_delay += self._last - now
        counts.max_delay = max(counts.max_delay, self._last - now)
        return self._last

    def _retries(self, size: int, fate: float) -> int:
        """Return the number of times that the unluckiest packet of the message is lost."""
        loss = self.impairment.loss.mean
        if loss <= 0:
            return 0
        any_lost = 1 - (1 - loss) ** _segments(size)
        if fate >= any_lost:
            return 0
        return min(1 + int(math.log(max(fate, 1e-12) / any_lost) / math.log(loss)), MAX_RETRIES)

    def _delay(self, now: float, share: float) -> float:
        if self.impairment.vary > 0:
            return self._wander.at(now, self.impairment.delay, self.impairment.vary)
        return self.impairment.delay.quantile(share)

    @property
    def _round_trip(self) -> float:
        return self.impairment.delay.mean + self._back

    @property
    def _timeout(self) -> float:
        return max(MIN_TIMEOUT, 2 * self._round_trip)

    def _recovery(self, size: int, retries: int) -> float:
        if retries == 0:
            return 0.0
        if _segments(size) >= FAST_RETRANSMIT:
            return self._round_trip + self._backed_off(retries - 1)
        return self._backed_off(retries)

    def _backed_off(self, times: int) -> float:
        """Return the duration of that many timeouts in a row."""
        return sum(min(math.ldexp(self._timeout, each), MAX_TIMEOUT) for each in range(times))

    def _after(self, silence: Silence, now: float) -> float:
        """Return the time when data sent at `now` gets through: held data at the end, lost data by the next try."""
        if silence.hold:
            return silence.until
        tried, timeout = now, self._timeout
        while tried < silence.until:
            tried += timeout
            timeout = min(timeout * 2, MAX_TIMEOUT)
        return tried


def _segments(size: int) -> int:
    return max(1, math.ceil(size / SEGMENT))
