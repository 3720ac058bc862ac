"""Reads the bridge's own log: commands, feedback and captures, with their times."""

from pathlib import Path

from lockstep.bench.experiment.judge.record import Arrival, RobotRecord
from lockstep.bench.harness.event_log import records

__all__ = ["read_robot_log"]


def read_robot_log(log: Path, since: float, until: float) -> RobotRecord:
    """Return the record of what happened between two moments on the monotonic clock."""
    found = RobotRecord()
    answered: set[int] = set()
    for record in records(log):
        kind, event = record["kind"], record["event"]
        if kind == "media":
            if since <= record["captured"] <= until:
                found.captured.setdefault(record["stream"], []).append(Arrival(record["captured"], event))
        elif not since <= record["time"] <= until:
            continue
        elif kind == "executed":
            found.executed.append(Arrival(record["time"], event))
        elif kind == "feedback" and event not in answered:
            answered.add(event)
            found.answered.append(Arrival(record["time"], event))
    return found
