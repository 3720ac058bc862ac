"""Counts and logs the console's own faults, never so often that the log is flooded."""

import time
from collections.abc import Callable
from typing import Any

import structlog
from prometheus_client import Counter

from lockstep.server.util.rate_limits import RateLimits

__all__ = ["Faults"]

LOGGED_RATE = 0.2  # Hz, of each place
LOGGED_BURST = 3

log = structlog.get_logger(__name__)


class Faults:
    """Counts every fault in `counter`, which has the label `where`, and logs it within a rate."""

    def __init__(self, counter: Counter, clock: Callable[[], float] = time.monotonic) -> None:
        self._counter = counter
        self._clock = clock
        self._logged = RateLimits(LOGGED_RATE, LOGGED_BURST)

    def caught(self, where: str, error: BaseException, **context: Any) -> None:
        """Count and log a fault. `where`: a stable name; `context` goes into the log. Raises nothing."""
        self._counter.labels(where).inc()
        if self._logged.spend(where, self._clock()):
            log.error("an internal fault of the console", where=where, exc_info=error, **context)

    def uncaught(self, loop: object, context: dict[str, Any]) -> None:
        """Handle exceptions that nobody awaited or a callback raised, for `loop.set_exception_handler`."""
        error = context.get("exception")
        if not isinstance(error, BaseException):
            error = RuntimeError(str(context.get("message", "")))
        self.caught("loop", error, what=str(context.get("message", "")))
