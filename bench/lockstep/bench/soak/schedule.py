"""Plans the disturbances of a session from a seed. No I/O."""

import random
from typing import Literal, NamedTuple

__all__ = ["Action", "Counts", "Kind", "counts_for", "schedule"]

Kind = Literal["kill_bridge", "restart_server", "cut_network", "stop", "join", "leave"]

SHORTEST_CUT, LONGEST_CUT = 0.3, 12.0  # s
STOPPED_SECONDS = 4.0  # between a stop and its reset
QUIET_START = 0.06  # share of the time in which everybody gets to connect
QUIET_END = 0.06  # and in which everybody has to come back
LAST_LIFE = 0.45  # share from which on the server lives without a restart, so that its memory can be judged


class Counts(NamedTuple):
    """The number of each disturbance."""

    bridge_kills: int
    server_restarts: int
    network_cuts: int
    stops: int


class Action(NamedTuple):
    at: float  # s after the start
    kind: Kind
    seconds: float = 0.0  # duration of a cut or a stop


def counts_for(minutes: float) -> Counts:
    """Return the counts of half an hour in proportion to `minutes`, each at least 1."""
    share = minutes / 30
    return Counts(*(max(1, round(count * share)) for count in (5, 3, 20, 10)))


def schedule(minutes: float, seed: int) -> list[Action]:
    """Return all actions in order. The same arguments give the same plan.

    Every kind is spread evenly, each action somewhere in its own slot.
    """
    chance = random.Random(seed)
    total = minutes * 60
    begin, end = total * QUIET_START, total * (1 - QUIET_END)
    counts = counts_for(minutes)
    plan = [
        *(Action(at, "kill_bridge") for at in _spread(chance, counts.bridge_kills, begin, end)),
        *(Action(at, "restart_server") for at in _spread(chance, counts.server_restarts, begin, total * LAST_LIFE)),
        *(Action(at, "stop", STOPPED_SECONDS) for at in _spread(chance, counts.stops, begin, end)),
        *(Action(at, "join" if turn % 2 else "leave") for turn, at in enumerate(_moves(chance, minutes, begin, end))),
    ]
    # The longest cut still leaves time before the next.
    longest = min(LONGEST_CUT, (end - begin) / counts.network_cuts / 3)
    cuts = _spread(chance, counts.network_cuts, begin, end - longest)
    plan += [Action(at, "cut_network", chance.uniform(SHORTEST_CUT, longest)) for at in cuts]
    return sorted(plan)


def _moves(chance: random.Random, minutes: float, begin: float, end: float) -> list[float]:
    """Return times of an observer's coming or going, about every ten seconds."""
    return _spread(chance, max(2, round(minutes * 6)), begin, end)


def _spread(chance: random.Random, count: int, begin: float, end: float) -> list[float]:
    slot = (end - begin) / count
    return [begin + slot * (index + chance.uniform(0.1, 0.9)) for index in range(count)]
