"""Tasks that run beside a block of code."""

import asyncio
from collections.abc import AsyncIterator, Coroutine
from contextlib import asynccontextmanager
from typing import Any

__all__ = ["background_tasks"]


@asynccontextmanager
async def background_tasks(*work: Coroutine[Any, Any, None]) -> AsyncIterator[None]:
    """Run `work` in a TaskGroup while entered, and cancel it on leaving.

    An exception of the block comes out as it is: the TaskGroup alone would wrap it.

    Raises:
        ExceptionGroup: some of the work has failed, which cancels the block.
    """
    failure: BaseException | None = None
    async with asyncio.TaskGroup() as tasks:
        running = [tasks.create_task(each) for each in work]
        try:
            yield
        except BaseException as error:
            failure = error  # raised behind the group
        for task in running:
            task.cancel()
    try:
        if failure is not None:
            raise failure
    finally:
        del failure  # which refers to this frame
