"""One direction of one path for packets. No I/O.

A packet passes these in order: an outage, the bottleneck's queue, loss, delay, order. Every packet takes the same
number of random numbers, with any fate and any setting: the fate of the n-th packet depends on the seed and n, on its
time if there is a bottleneck, an outage or a delay that wanders, and on nothing else.
"""

from dataclasses import dataclass
from random import Random

from lockstep.emulator.impairment.bottleneck import Bottleneck
from lockstep.emulator.impairment.impairment import Impairment, Wander
from lockstep.emulator.impairment.loss import LossState
from lockstep.emulator.impairment.outages import Outages

__all__ = ["ImpairedPath", "PathStatistics"]


@dataclass
class PathStatistics:
    """Counts since the beginning; delays in seconds, over what passed, waiting in the bottleneck's queue included."""

    offered: int = 0
    passed: int = 0
    lost: int = 0
    queue_dropped: int = 0
    outage_dropped: int = 0
    held: int = 0  # held by an outage, and passed after it
    reordered: int = 0
    bytes: int = 0  # of the packets that passed
    total_delay: float = 0.0
    max_delay: float = 0.0

    @property
    def mean_delay(self) -> float:
        return self.total_delay / self.passed if self.passed else 0.0

    def add(self, other: "PathStatistics") -> None:
        """Add another path's counts."""
        for name in ("offered", "passed", "lost", "queue_dropped", "outage_dropped", "held", "reordered", "bytes"):
            setattr(self, name, getattr(self, name) + getattr(other, name))
        self.total_delay += other.total_delay
        self.max_delay = max(self.max_delay, other.max_delay)


class ImpairedPath:
    """One direction of a path. Call `admit` for every packet, in order of time.

    Args:
        seed: the same seed and the same packets at the same times meet the same fate
        bottleneck: may be shared with other paths; None: any rate passes
        outages: may be shared too
    """

    def __init__(
        self, impairment: Impairment, seed: str, bottleneck: Bottleneck | None = None, outages: Outages | None = None
    ) -> None:
        self.impairment = impairment  # may be changed at any time
        self.statistics = PathStatistics()
        self._random = Random(seed)
        self._wander = Wander(Random(f"{seed} wander"))
        self._loss = LossState()
        self._bottleneck = bottleneck
        self._outages = outages
        self._last = 0.0  # arrival of the last packet that keeps the order

    def admit(self, now: float, size: int) -> float | None:
        """Return the time at which the packet arrives; None if it never does."""
        change, fate, share, swap = (self._random.random() for _ in range(4))
        counts, impairment = self.statistics, self.impairment
        counts.offered += 1
        lost = self._loss.loses(impairment.loss, change, fate, now)
        silence = None if self._outages is None else self._outages.at(now)
        if silence is not None and not silence.hold:
            counts.outage_dropped += 1
            return None
        leaves: float | None = now
        if self._bottleneck is not None:
            leaves = self._bottleneck.admit(now, size)
        if leaves is None:
            counts.queue_dropped += 1
            return None
        if lost:
            counts.lost += 1
            return None
        arrives = self._ordered(leaves + self._delay(leaves, share), swap)
        if silence is not None:
            counts.held += 1
            self._last = arrives = max(arrives, silence.until, self._last)
        counts.passed += 1
        counts.bytes += size
        counts.total_delay += arrives - now
        counts.max_delay = max(counts.max_delay, arrives - now)
        return arrives

    def _delay(self, now: float, share: float) -> float:
        if self.impairment.vary > 0:
            return self._wander.at(now, self.impairment.delay, self.impairment.vary)
        return self.impairment.delay.quantile(share)

    def _ordered(self, arrives: float, swap: float) -> float:
        """Return the time of arrival in order.

        A real queue is first in, first out, at any delay; reordered packets are outside of it.
        """
        reorder = self.impairment.reorder
        if reorder is not None and swap < reorder.share:
            self.statistics.reordered += 1
            return max(arrives, self._last) + reorder.late
        self._last = max(arrives, self._last)
        return self._last
