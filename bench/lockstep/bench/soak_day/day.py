"""The plan of a day of use, how much of the day runs have done, and whether the promises held. No I/O.

A day is not the hours in which a robot stands, but its events: people take over from each other, come and go, networks
and processes fail, recordings begin and end, pictures are rendered. Runs of any length add up to a day.
"""

import random
from collections import Counter
from collections.abc import Mapping, Sequence
from statistics import median
from typing import Any, Literal, NamedTuple

import msgspec

__all__ = ["DAY", "HOURS", "Action", "Kind", "Leg", "drift", "plan", "summary"]

Kind = Literal[
    "hand_over", "join", "leave", "cut_network", "stop", "kill_bridge", "restart_console", "kill_relay",
    "begin_recording", "end_recording",
]  # fmt: skip

HOURS = 2.0  # into which a day is compressed
# How often each happens in a day of 24 hours.
DAY: Mapping[str, int] = {
    "hand_over": 96,
    "join": 240,
    "leave": 240,
    "cut_network": 96,
    "stop": 48,
    "kill_bridge": 12,
    "restart_console": 6,
    "kill_relay": 12,
    "begin_recording": 48,
    "end_recording": 48,
    "pictures": 1_000_000,
}
BROKEN = (
    "executed_twice",
    "executed_late",
    "moved_without_seat",
    "moved_while_stopped",
    "reloads_needed",
    "violations",
    "recordings_broken",
)
SHORTEST_CUT, LONGEST_CUT = 0.3, 12.0  # s
STOPPED_SECONDS = 4.0  # between a stop and its reset
QUIET = 0.06  # share of a run at either end in which nothing is disturbed
CALM_FROM = 0.5  # share from which on the console lives without a restart, so that its memory can be judged
GROWTH = 0.05  # of a console's memory in a run: the most that counts as flat
DRIFT = 1.25  # the last third of a run against its first: the most that counts as no drift, on a machine that is shared
ENOUGH = 20  # samples in either third


class Action(NamedTuple):
    at: float  # s after the run began
    kind: Kind
    seconds: float = 0.0  # how long a cut or a stop lasts


class Leg(msgspec.Struct, kw_only=True):
    """One run: its actions, and its findings."""

    began: str  # ISO 8601, for people
    seconds: float
    seed: int
    done: dict[str, int]  # how often each kind of action was done
    pictures: dict[str, int]  # rendered, by page
    relayed: dict[str, int]  # of them, by the relay that they came through
    broken: dict[str, int]  # each of BROKEN
    executed: int
    memory_growth: float | None  # of the console in its last life; None: too short to say
    feedback_drift: float | None  # command → feedback, the last third against the first
    picture_drift: float | None  # the same of the pictures' delay


def plan(minutes: float, seed: int) -> list[Action]:
    """Return the actions of a run in order: as much of a day as `minutes` are of `HOURS`, each kind at least once.

    Every kind is spread evenly, each action somewhere in its own slot. The same arguments give the same plan.
    """
    chance = random.Random(seed)
    total, share = minutes * 60, minutes / (HOURS * 60)
    begin, end = total * QUIET, total * (1 - QUIET)
    found: list[Action] = []
    for kind in ("hand_over", "join", "leave", "kill_bridge", "kill_relay"):
        found += [Action(at, kind) for at in _spread(chance, _count(kind, share), begin, end)]
    found += [
        Action(at, "restart_console")
        for at in _spread(chance, _count("restart_console", share), begin, total * CALM_FROM)
    ]
    found += [Action(at, "stop", STOPPED_SECONDS) for at in _spread(chance, _count("stop", share), begin, end)]
    cuts = _count("cut_network", share)
    longest = min(LONGEST_CUT, (end - begin) / cuts / 3)
    for at in _spread(chance, cuts, begin, end - longest):
        found.append(Action(at, "cut_network", chance.uniform(min(SHORTEST_CUT, longest), longest)))
    recordings = _count("begin_recording", share)
    slot = (end - begin) / recordings
    for index in range(recordings):
        found.append(Action(begin + slot * (index + 0.1), "begin_recording"))
        found.append(Action(begin + slot * (index + 0.9), "end_recording"))
    return sorted(found)


def drift(samples: Sequence[float]) -> float | None:
    """Return the median of the last third over that of the first; None for too few samples."""
    size = len(samples) // 3
    if size < ENOUGH:
        return None
    first, last = median(samples[:size]), median(samples[-size:])
    return last / first if first > 0 else None


def summary(legs: Sequence[Leg]) -> dict[str, Any]:
    """Return how much of a day all runs together have done, and whether the promises held in each run."""
    done: Counter[str] = Counter()
    pictures: Counter[str] = Counter()
    relayed: Counter[str] = Counter()
    broken: Counter[str] = Counter(dict.fromkeys(BROKEN, 0))
    for leg in legs:
        done.update(leg.done)
        pictures.update(leg.pictures)
        relayed.update(leg.relayed)
        broken.update(leg.broken)
    counts = {**{kind: done[kind] for kind in DAY}, "pictures": pictures.total()}
    growths = [leg.memory_growth for leg in legs if leg.memory_growth is not None]
    drifts = [each for leg in legs for each in (leg.feedback_drift, leg.picture_drift) if each is not None]
    return {
        "runs": len(legs),
        "hours": round(sum(leg.seconds for leg in legs) / 3600, 2),
        "day": {name: f"{counts[name]} of {target}" for name, target in DAY.items()},
        "pictures_by_page": dict(pictures),
        "pictures_by_relay": dict(relayed),
        "executed": sum(leg.executed for leg in legs),
        **{name: broken[name] for name in BROKEN},
        "largest_memory_growth": max(growths, default=None),
        "largest_drift": max(drifts, default=None),
        "verdicts": {
            "nothing_broken": not any(broken.values()),
            "memory_flat": bool(growths) and max(growths) <= GROWTH,
            "no_drift": bool(drifts) and max(drifts) <= DRIFT,
            "day_complete": all(counts[name] >= target for name, target in DAY.items()),
        },
    }


def _count(kind: str, share: float) -> int:
    return max(1, round(DAY[kind] * share))


def _spread(chance: random.Random, count: int, begin: float, end: float) -> list[float]:
    slot = (end - begin) / count
    return [begin + slot * (index + chance.uniform(0.1, 0.9)) for index in range(count)]
