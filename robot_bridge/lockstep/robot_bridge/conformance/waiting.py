"""Waiting for what a bridge has to do: what it does not do in time is a violation with words."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from lockstep.robot_bridge.conformance.errors import Violation

__all__ = ["PATIENCE", "within"]

PATIENCE = 5.0  # s for an answer that has to come; waited for in full only where it does not come


@asynccontextmanager
async def within(seconds: float, otherwise: str) -> AsyncIterator[None]:
    """Raises:
    Violation: the block took longer.
    """
    try:
        async with asyncio.timeout(seconds):
            yield
    except TimeoutError:
        raise Violation(otherwise) from None
