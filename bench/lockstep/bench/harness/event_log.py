"""Reads the bridge's own record of events over all its lives, with times on the machine's monotonic clock."""

import json
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

__all__ = ["Record", "capture_times", "records", "robot_times"]

Record = Mapping[str, Any]


def records(log: Path) -> Iterator[Record]:
    """Yield the records. Half a line is passed over: it is being written, or a killed bridge left it."""
    with log.open() as lines:
        for line in lines:
            with suppress(ValueError):
                yield json.loads(line)


def robot_times(log: Path) -> dict[int, float]:
    """Return the seconds from executing a command to issuing its feedback, the robot's own share, by event."""
    executed: dict[int, float] = {}
    taken: dict[int, float] = {}
    for record in records(log):
        event = record["event"]
        if record["kind"] == "executed":
            executed[event] = record["time"]
        elif record["kind"] == "feedback" and event in executed and event not in taken:
            taken[event] = record["time"] - executed[event]
    return taken


def capture_times(log: Path, stream: str) -> list[float]:
    """Return the time of capture of each picture of a stream, in order."""
    return [record["captured"] for record in records(log) if record["kind"] == "media" and record["stream"] == stream]
