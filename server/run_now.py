"""Coroutines that have nothing to wait for, run without a task."""

from collections.abc import Coroutine
from typing import Any

__all__ = ["run_now"]


def run_now(coroutine: Coroutine[Any, Any, object]) -> None:
    """Run to the end, in the caller's own turn of the loop. What it raises is raised.

    Raises:
        RuntimeError: it would wait for something. It has been closed.
    """
    try:
        coroutine.send(None)
    except StopIteration:
        return
    coroutine.close()
    raise RuntimeError(f"{coroutine} waits for something")
