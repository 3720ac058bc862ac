"""Which events are the rows of an episode when a dataset has a rate of its own. No I/O.

Row k belongs to the moment k / rate after the episode's first row, by the bridge's clock. It is the newest event that
had been executed by then, as a whole: with its own state, action and pictures. So an event is in no row where others
came within one interval, and in several where none followed. Nothing is interpolated. When no event follows for LONGEST
the robot was not driven; the moments until the next event have no rows.
"""

from collections.abc import Sequence
from typing import NamedTuple

__all__ = ["LONGEST", "ROUNDING", "Sample", "sampled"]

LONGEST = 1.0  # s that an event stands for, at most; commands of an operator who is armed come 5 times a second

ROUNDING = 1e-6  # s: a clock that counts in decimal fractions meets a moment that is a binary one


class Sample(NamedTuple):
    place: int  # of the event
    age: float  # s from the event to the row's moment


def sampled(times: Sequence[float], rate: int) -> list[Sample]:
    """Return the rows of an episode.

    Args:
        times: s, of the events, by the bridge's clock; they go up
        rate: Hz, of the rows
    """
    found: list[Sample] = []
    if not times:
        return found
    place, step = 0, 0
    while True:
        moment = times[0] + step / rate
        step += 1
        while place + 1 < len(times) and times[place + 1] <= moment + ROUNDING:
            place += 1
        age = max(moment - times[place], 0.0)
        if age <= LONGEST:
            found.append(Sample(place, age))
        elif place + 1 < len(times):  # on to the first moment that the next event has
            step = max(step, int((times[place + 1] - times[0]) * rate))
        if place + 1 == len(times):
            return found
