"""Judges an outage by the bridge's own log alone. Times in s on one monotonic clock. No I/O."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from lockstep.bench.harness.event_log import Record

__all__ = ["Cut", "Finding", "judge_outage"]

LATE_TICKS = 0.02  # s; the robot's tick is 4 ms, and a busy machine skips some


class Cut(NamedTuple):
    """The cut of the network."""

    began: float
    ended: float
    held: bool  # packets waited in the network and arrived at its end; else they were lost


@dataclass(frozen=True)
class Finding:
    """The figures of an outage; None if the log does not tell."""

    rest_seconds: float | None  # from the last command executed to the axes at rest
    hold: float  # s, the most that this may take
    oldest_answer: float  # s from a feedback to the latest command executed as its answer, from the cut on
    oldest_intention: float | None  # s from an intention to its execution after the outage, the longest
    max_event_age: float  # s, the most that the two may be
    control_seconds: float | None  # from the network's return to the first command that moves
    silent_seconds: float = 0.0  # of these, in which the path had an outage of its own

    @property
    def rested_within_hold(self) -> bool:
        return self.rest_seconds is not None and self.rest_seconds <= self.hold + LATE_TICKS

    @property
    def nothing_queued_executed(self) -> bool:
        return max(self.oldest_answer, self.oldest_intention or 0.0) <= self.max_event_age


def judge_outage(
    log: Iterable[Record],
    cut: Cut,
    *,
    hold: float,
    max_event_age: float,
    intentions: Sequence[tuple[float, float]] = (),
) -> Finding:
    """Return the finding.

    `log`: the bridge's records. `intentions`: (time, value of the first axis), each value once; empty: unknown.
    """
    issued: dict[tuple[int, int], float] = {}
    executed: list[Record] = []
    rested: list[float] = []
    for record in log:
        if record["kind"] == "feedback":
            issued[record["event"], record["issue"]] = record["time"]
        elif record["kind"] == "executed":
            executed.append(record)
        elif record["kind"] == "at_rest":
            rested.append(record["time"])
    after = [record for record in executed if record["time"] >= cut.began]
    back = [record for record in executed if record["time"] >= cut.ended]
    last = max((record["time"] for record in executed if record["time"] < cut.ended), default=None)
    rest = next((time for time in rested if last is not None and time > last), None)
    intended = {round(value, 6): time for time, value in intentions}
    firsts = [(record, record["values"][0]) for record in back]  # None: a goal axis was to stay
    known = [(record, intended.get(round(value, 6))) for record, value in firsts if value is not None]
    moved = next((record["time"] for record in back if any(record["values"])), None)
    return Finding(
        rest_seconds=None if rest is None or last is None else rest - last,
        hold=hold,
        oldest_answer=max((_age(record, issued) for record in after), default=0.0),
        oldest_intention=max((record["time"] - time for record, time in known if time is not None), default=None),
        max_event_age=max_event_age,
        control_seconds=None if moved is None else moved - cut.ended,
    )


def _age(record: Record, issued: dict[tuple[int, int], float]) -> float:
    """Return the age of the feedback that an executed command answers; infinite if no issue has that number."""
    answered = [(event, issue) for event, issue in issued if issue == record["issue"] and event < record["event"]]
    return record["time"] - issued[max(answered)] if answered else float("inf")
