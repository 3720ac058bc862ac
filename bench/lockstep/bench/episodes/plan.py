"""What becomes of each episode, and who drives it. No I/O, no clock."""

import random
from typing import Final, Literal, NamedTuple

__all__ = ["DRIVERS", "POLICY", "Fate", "Planned", "plan"]

Fate = Literal["success", "failure", "discard", "redo"]
DRIVERS: Final = ("Ada", "Grace", "net")  # two people and a policy
POLICY: Final = 2  # place in DRIVERS
SHARED: Final = 2  # of so many episodes of a person one changes hands in its middle
FAILED: Final = 4  # of so many kept ones one is a failure


class Planned(NamedTuple):
    """One episode.

    Attributes:
        fate: redo: its first take is discarded, and its second one is kept as a success
        person: place in DRIVERS of who begins it
        turns: places in DRIVERS of those who drive it, in their order; a person after the policy takes over from it
    """

    number: int
    fate: Fate
    person: int
    turns: tuple[int, ...]


def plan(times: int, discard: int, redo: int, seed: int) -> list[Planned]:
    """Plan `times` episodes, of which so many are discarded and redone. Raises ValueError: more than there are."""
    odd = random.Random(seed).sample(range(times), discard + redo)
    discarded, redone = set(odd[:discard]), set(odd[discard:])
    planned: list[Planned] = []
    for number in range(times):
        kept: Fate = "failure" if number % FAILED == FAILED - 1 else "success"
        fate: Fate = "discard" if number in discarded else "redo" if number in redone else kept
        planned.append(Planned(number, fate, *_drivers(number)))
    return planned


def _drivers(number: int) -> tuple[int, tuple[int, ...]]:
    """Return who begins the episode of this number, and its turns: the policy drives in each third one."""
    third, driver = divmod(number, len(DRIVERS))
    if driver != POLICY:
        shared = number % (SHARED * len(DRIVERS)) == driver * (len(DRIVERS) + 1)
        return driver, (driver, 1 - driver) if shared else (driver,)
    person = third % POLICY
    other = 1 - person
    ways: tuple[tuple[int, ...], ...] = (
        (POLICY, other, POLICY),  # is corrected by somebody who did not let it drive, and gets the robot back
        (POLICY,),
        (person, POLICY, person, POLICY),  # follows a demonstration, and is corrected
        (POLICY, person),  # is taken over for good
    )
    return person, ways[third % len(ways)]
