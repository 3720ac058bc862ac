"""A monotonic clock that goes on while the machine sleeps."""

import time

__all__ = ["steady_time"]


def steady_time() -> float:
    """Return monotonic s, which count also while the machine sleeps, where the system can tell."""
    return time.clock_gettime(time.CLOCK_BOOTTIME) if hasattr(time, "CLOCK_BOOTTIME") else time.monotonic()
