"""Waits for something that a bridge must do, and turns a timeout into a violation."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from lockstep.robot_bridge.conformance.errors import Violation

__all__ = ["PATIENCE", "SETTLE", "within"]

PATIENCE = 5.0  # s for an answer that has to come; waited for in full only if it does not come
SETTLE = 0.5  # s that a robot may take to stand still after what is commanded is at rest


@asynccontextmanager
async def within(seconds: float, otherwise: str) -> AsyncIterator[None]:
    """Bound the time of a block. `otherwise`: the text of the violation.

    Raises:
        Violation: the block took longer.
    """
    try:
        async with asyncio.timeout(seconds):
            yield
    except TimeoutError:
        raise Violation(otherwise) from None
