"""Our own faults: each one is counted where it was caught, and logged, but never so often that the log is flooded."""

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
    """Counts in `counter`, which has the label `where`."""

    def __init__(self, counter: Counter, clock: Callable[[], float] = time.monotonic) -> None:
        self._counter = counter
        self._clock = clock
        self._logged = RateLimits(LOGGED_RATE, LOGGED_BURST)

    def caught(self, where: str, error: BaseException, **context: Any) -> None:
        """`where`: a stable name; `context` goes into the log. Raises nothing."""
        self._counter.labels(where).inc()
        if self._logged.spend(where, self._clock()):
            log.error("a fault of the console's own", where=where, exc_info=error, **context)

    def uncaught(self, loop: object, context: dict[str, Any]) -> None:
        """For `loop.set_exception_handler`: what nobody awaited, and what a callback of the loop raised."""
        error = context.get("exception")
        if not isinstance(error, BaseException):
            error = RuntimeError(str(context.get("message", "")))
        self.caught("loop", error, what=str(context.get("message", "")))
