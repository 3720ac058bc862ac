"""Decides about lost packets by the Gilbert–Elliott model, of which independent loss is a case. No I/O.

The path is in a good or a bad state and changes between them with fixed probabilities at every packet; each state has
its own probability of losing a packet. A burst lasts milliseconds: after a pause the state is drawn anew, or five
packets of a path that has one every other second would be lost for ten seconds on end.
"""

from dataclasses import dataclass

__all__ = ["NO_LOSS", "Loss", "LossState", "bursty", "independent"]

PAUSE = 0.5  # s


@dataclass(frozen=True)
class Loss:
    """The four probabilities of the model."""

    to_bad: float = 0.0  # good → bad, at each packet
    to_good: float = 1.0  # bad → good
    good: float = 0.0  # loss while good
    bad: float = 0.0  # loss while bad

    @property
    def in_bad(self) -> float:
        """The share of packets that meet the bad state in the long run."""
        changing = self.to_bad + self.to_good
        return self.to_bad / changing if changing else 0.0

    @property
    def mean(self) -> float:
        """The share of packets lost in the long run."""
        return self.in_bad * self.bad + (1 - self.in_bad) * self.good


NO_LOSS = Loss()


def independent(share: float) -> Loss:
    """Return the loss of each packet independently of the others."""
    return Loss(good=share, bad=share)


def bursty(share: float, length: float, *, good: float = 0.0, bad: float = 1.0) -> Loss:
    """Return the loss of `share` of all packets, with a bad state that lasts `length` packets on average.

    Args:
        good, bad: share lost in each state; by default all of it is lost in the bad state and nothing in the good

    Raises:
        ValueError: no such path exists.
    """
    if length < 1:
        raise ValueError("a burst lasts at least 1 packet")
    if not good <= share < bad:
        raise ValueError("the mean loss lies between the loss of the good state and that of the bad one")
    in_bad = (share - good) / (bad - good)
    to_good = 1 / length
    to_bad = to_good * in_bad / (1 - in_bad)
    if to_bad > 1:
        raise ValueError(f"bursts of {length:g} packets are too short for so much loss")
    return Loss(to_bad=to_bad, to_good=to_good, good=good, bad=bad)


class LossState:
    """The state of one path. Each packet takes two uniform numbers."""

    def __init__(self) -> None:
        self._bad = False
        self._last = -float("inf")  # s, when the last packet came

    def loses(self, loss: Loss, change: float, fate: float, now: float) -> bool:
        """Return whether the packet that comes `now` (s) is lost."""
        if now - self._last > PAUSE:
            self._bad = change < loss.in_bad
        else:
            self._bad = change >= loss.to_good if self._bad else change < loss.to_bad
        self._last = now
        return fate < (loss.bad if self._bad else loss.good)
