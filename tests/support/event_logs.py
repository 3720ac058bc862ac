"""Reading the event log of a bridge that goes on writing it."""

import asyncio
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

__all__ = ["PATIENCE", "whole_lines", "written"]

PATIENCE = 30.0  # s, for what a process has done to be in its log


async def written(log: Path, ended: Callable[[], bool] = lambda: False) -> list[dict[str, Any]]:
    """All that a bridge has recorded until this call.

    A thread of its own writes the log, a moment later: this waits until the log says something newer, as a bridge that
    runs does twice a second at least. Once `ended` the log is read as it is.
    """
    now = time.monotonic()  # as the records have it
    async with asyncio.timeout(PATIENCE):
        while True:
            over = ended()
            found = whole_lines(log)
            if over or (found and found[-1]["time"] > now):
                return found
            await asyncio.sleep(0.01)


def whole_lines(log: Path) -> list[dict[str, Any]]:
    """The records of an event log, but for the one that is just being written."""
    whole, _, _ = log.read_bytes().rpartition(b"\n")
    return [json.loads(line) for line in whole.splitlines()]
