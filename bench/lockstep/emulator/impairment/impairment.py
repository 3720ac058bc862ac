"""The impairments of one direction of a path as values, and the motion of its delay with time. No I/O."""

from dataclasses import dataclass
from random import Random

from lockstep.emulator.impairment.delay import NO_DELAY, Delay
from lockstep.emulator.impairment.loss import NO_LOSS, Loss

__all__ = ["PERFECT", "Impairment", "Reordering", "Wander"]

MAX_SKIPPED = 100_000  # draws after a pause; a longer one starts anew


@dataclass(frozen=True)
class Reordering:
    share: float  # 0 to 1 of all packets
    late: float  # s of further delay; other packets overtake them


@dataclass(frozen=True)
class Impairment:
    """The impairments of one direction."""

    delay: Delay = NO_DELAY
    loss: Loss = NO_LOSS
    vary: float = 0.0  # s between two draws of the delay, which moves evenly between them; 0: a draw for each packet
    reorder: Reordering | None = None


PERFECT = Impairment()


class Wander:
    """A delay that moves between values drawn at even distances in time, as the queues of a real network do.

    Its mean, least and largest value are those of the distribution. If it were drawn for each packet, a path that
    keeps the order would make a stream of many packets as slow as its slowest packet.
    """

    def __init__(self, random: Random) -> None:
        self._random = random
        self._began: float | None = None
        self._knot = 0
        self._from = 0.0  # uniform numbers, so that a changed distribution keeps the pattern
        self._to = 0.0
        self._ends: tuple[Delay, float, float] | None = None  # the same as delays

    def at(self, now: float, delay: Delay, every: float) -> float:
        if self._began is None:
            self._began = now
            self._from, self._to = self._random.random(), self._random.random()
        position = max(0.0, (now - self._began) / every)
        knot = max(int(position), self._knot)
        for _ in range(min(knot - self._knot, MAX_SKIPPED)):
            self._from, self._to = self._to, self._random.random()
        if knot != self._knot or self._ends is None or self._ends[0] is not delay:
            self._ends = delay, delay.quantile(self._from), delay.quantile(self._to)
        self._knot = knot
        part = max(0.0, position - knot)
        return (1 - part) * self._ends[1] + part * self._ends[2]
