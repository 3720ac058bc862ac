"""Tells a helper process that the process which started it has ended, in whatever way."""

import asyncio
import os
from collections.abc import Sequence

__all__ = ["STARTED_BY", "parent_ended", "parent_of"]

INTERVAL = 0.5  # s between two looks; no system call waits for the end of a parent
# Read when this module is imported, before the helper answers anything: a parent that has its answer may end before the
# helper looks for the first time, and would then be taken for the process that inherits its children.
STARTED_BY = os.getppid()


def parent_of(arguments: Sequence[str]) -> int:
    """Return the process whose end is this one's.

    Args:
        arguments: the helper's own; the first is the number of the process that wants the helper, if it says so. One
            that has ended since, while this one was starting, is returned. Where it lives but did not start this
            process, another program stands between them, and that one is returned.

    Raises:
        ValueError: the first argument is no number.
    """
    named = int(arguments[0]) if arguments else STARTED_BY
    return STARTED_BY if named == STARTED_BY or _lives(named) else named


def _lives(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        pass  # of another user
    return True


async def parent_ended(parent: int = STARTED_BY, *, interval: float = INTERVAL) -> None:
    """Return when the process `parent` has ended; at once if it had before. It has to have started this process."""
    while os.getppid() == parent:  # noqa: ASYNC110
        await asyncio.sleep(interval)
