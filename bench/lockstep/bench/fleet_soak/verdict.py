"""Judges a fleet's soak. No I/O."""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

from lockstep.bench.figures.samples import median, quantile
from lockstep.bench.fleet_soak.driver import FleetDriver, Trip
from lockstep.bench.fleet_soak.progress import Progress
from lockstep.bench.harness.event_log import Record
from lockstep.bench.soak.judge import Judge

__all__ = ["MUST_BE_ZERO", "Span", "fleet_verdict", "robot_verdict"]

MUST_BE_ZERO = ("executed_twice", "executed_late", "events_skipped", "seats_lost", "connections_lost", "other_troubles")
MAX_EVENT_AGE, HOLD = 2.0, 0.3  # of the planar robot


class Span(NamedTuple):
    """A part of the run, on the monotonic clock."""

    began: float
    ended: float
    robot: str  # the robot whose bridge was away; "": none


def robot_verdict(driver: FleetDriver, records: Sequence[Record]) -> dict[str, Any]:
    judge, progress = Judge(MAX_EVENT_AGE, HOLD), Progress()
    judge.read(records)
    progress.read(records)
    seats, lost = driver.noticed["no_seat"] + driver.noticed["SeatRefused"], driver.noticed["ConsoleLost"]
    return {
        "events": judge.verdict["executed"],
        "lives": judge.verdict["epochs"],
        "longest_pause_ms": round(progress.longest_pause * 1000, 1),
        "events_skipped": progress.skipped,
        "executed_twice": judge.verdict["executed_twice"],
        "executed_late": judge.verdict["executed_late"],
        "seats_lost": seats,
        "connections_lost": lost,
        "other_troubles": driver.noticed.total() - seats - lost,
        "noticed": dict(driver.noticed),
        "slowest_return_seconds": round(driver.slowest_return, 1),
    }


def fleet_verdict(
    drivers: Sequence[FleetDriver], robots: dict[str, dict[str, Any]], calm: Span, kills: Sequence[Span]
) -> dict[str, Any]:
    """Return the verdict on the fleet.

    `calm`: the part in which all bridges lived; `kills`: from each death until that robot was driven again.
    """
    calmly = _times(each for driver in drivers for each in driver.trips if _within(each, calm))
    meanwhile = _times(
        each
        for driver in drivers
        for kill in kills
        if kill.robot != driver.name
        for each in driver.trips
        if _within(each, kill)
    )
    ratio = median(meanwhile) / median(calmly) if calmly and meanwhile else None
    return {
        **{name: sum(each[name] for each in robots.values()) for name in ("events", *MUST_BE_ZERO)},
        "longest_pause_ms": max(each["longest_pause_ms"] for each in robots.values()),
        "kills": len(kills),
        "survivors_ratio": None if ratio is None else round(ratio, 3),
        "calm": _in_words(calmly),
        "survivors_in_kills": _in_words(meanwhile),
        "robots": robots,
    }


def _within(trip: Trip, span: Span) -> bool:
    return span.began <= trip.answered - trip.seconds and trip.answered <= span.ended


def _times(trips: Iterable[Trip]) -> list[float]:
    return [trip.seconds for trip in trips]


def _in_words(times: list[float]) -> dict[str, float | int]:
    """Return the percentiles of command to feedback, ms."""
    if not times:
        return {"trips": 0}
    shares = {"median_ms": 0.5, "p95_ms": 0.95, "p99_ms": 0.99, "maximum_ms": 1.0}
    return {"trips": len(times), **{name: round(quantile(times, at) * 1000, 2) for name, at in shares.items()}}
