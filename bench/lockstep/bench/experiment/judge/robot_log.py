"""Reads the bridge's own log: commands, feedback and captures, with their times."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from lockstep.bench.experiment.judge.record import Arrival, RobotRecord

__all__ = ["read_robot_log", "records"]


def records(log: Path) -> Iterator[dict[str, Any]]:
    """Yield the whole lines: the last one may still be being written."""
    text = log.read_text()
    for line in text[: text.rfind("\n") + 1].splitlines():
        yield json.loads(line)


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
