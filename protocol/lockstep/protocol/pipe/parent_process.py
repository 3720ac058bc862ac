"""Tells a helper process that the process which started it has ended, in whatever way."""

import asyncio
import os

__all__ = ["STARTED_BY", "parent_ended"]

INTERVAL = 0.5  # s between two looks; no system call waits for the end of a parent
# Read when this module is imported, before the helper answers anything: a parent that has its answer may end before the
# helper looks for the first time, and would then be taken for the process that inherits its children.
STARTED_BY = os.getppid()


async def parent_ended(parent: int = STARTED_BY, *, interval: float = INTERVAL) -> None:
    """Return when the process `parent` has ended; at once if it had before. It has to have started this process."""
    while os.getppid() == parent:  # noqa: ASYNC110
        await asyncio.sleep(interval)
