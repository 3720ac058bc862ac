"""No test of the server may leave a task behind."""

import asyncio
from collections.abc import AsyncIterator

import pytest

SETTLE = 3.0  # s for tasks that were told to end


@pytest.fixture(autouse=True)
async def no_task_is_left() -> AsyncIterator[None]:
    before = asyncio.all_tasks()
    yield
    left = asyncio.all_tasks() - before - {asyncio.current_task()}
    if left:
        _, left = await asyncio.wait(left, timeout=SETTLE)
    assert not left, f"tasks left behind: {left}"
