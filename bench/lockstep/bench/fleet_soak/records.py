"""Reads the event logs of a bridge over several lives."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

__all__ = ["Record", "read_records"]

Record = Mapping[str, Any]


def read_records(log: Path) -> list[Record]:
    """Read the records of a log; half a line, which a killed bridge may leave, is passed over."""
    found: list[Record] = []
    with log.open() as lines:
        for line in lines:
            try:
                found.append(json.loads(line))
            except ValueError:
                continue
    return found
