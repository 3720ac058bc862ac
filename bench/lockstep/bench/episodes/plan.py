"""What becomes of each episode, and who drives it. No I/O, no clock."""

import random
from typing import Final, Literal, NamedTuple

__all__ = ["DRIVERS", "Fate", "Planned", "plan"]

Fate = Literal["success", "failure", "discard", "redo"]
DRIVERS: Final = ("Ada", "Grace")
SHARED: Final = 5  # of so many episodes one changes hands in its middle
FAILED: Final = 4  # of so many kept ones one is a failure


class Planned(NamedTuple):
    """One episode.

    Attributes:
        fate: redo: its first take is discarded, and its second one is kept as a success
        driver: place in DRIVERS of the one who begins it
        shared: the other one drives its second half
    """

    number: int
    fate: Fate
    driver: int
    shared: bool


def plan(times: int, discard: int, redo: int, seed: int) -> list[Planned]:
    """Plan `times` episodes, of which so many are discarded and redone. Raises ValueError: more than there are."""
    odd = random.Random(seed).sample(range(times), discard + redo)
    discarded, redone = set(odd[:discard]), set(odd[discard:])
    planned: list[Planned] = []
    for number in range(times):
        kept: Fate = "failure" if number % FAILED == FAILED - 1 else "success"
        fate: Fate = "discard" if number in discarded else "redo" if number in redone else kept
        planned.append(Planned(number, fate, number % len(DRIVERS), number % SHARED == SHARED - 1))
    return planned
