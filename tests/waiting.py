"""Waits for what has no event to wait for."""

import asyncio
from collections.abc import Callable

__all__ = ["PATIENCE", "eventually"]

PATIENCE = 30.0  # s; a busy machine, never waited for in full


async def eventually(state: Callable[[], object], seconds: float = PATIENCE) -> None:
    """Return once `state` holds."""
    async with asyncio.timeout(seconds):
        while not state():  # noqa: ASYNC110
            await asyncio.sleep(0.01)
