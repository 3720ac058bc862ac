"""Reads the bridge's own record of events, with times on the machine's monotonic clock."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

__all__ = ["capture_times", "robot_times"]


def robot_times(log: Path) -> dict[int, float]:
    """Return the seconds from executing a command to issuing its feedback, the robot's own share, by event."""
    executed: dict[int, float] = {}
    taken: dict[int, float] = {}
    for record in _records(log):
        event = record["event"]
        if record["kind"] == "executed":
            executed[event] = record["time"]
        elif record["kind"] == "feedback" and event in executed and event not in taken:
            taken[event] = record["time"] - executed[event]
    return taken


def capture_times(log: Path, stream: str) -> list[float]:
    """Return the time of capture of each picture of a stream, in order."""
    return [record["captured"] for record in _records(log) if record["kind"] == "media" and record["stream"] == stream]


def _records(log: Path) -> Iterator[dict[str, Any]]:
    """Yield the whole lines: the last one may still be being written."""
    text = log.read_text()
    for line in text[: text.rfind("\n") + 1].splitlines():
        yield json.loads(line)
