"""Tells a helper process that the process which started it has ended, in whatever way."""

import asyncio
import os

__all__ = ["parent_ended"]

INTERVAL = 0.5  # s between two looks; no system call waits for the end of a parent


async def parent_ended(interval: float = INTERVAL) -> None:
    """Return when the parent that this process has now has ended."""
    parent = os.getppid()
    while os.getppid() == parent:  # noqa: ASYNC110
        await asyncio.sleep(interval)
