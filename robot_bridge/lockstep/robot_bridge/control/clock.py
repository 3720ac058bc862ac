"""The clock by which motion is bounded: it goes on while the machine is suspended.

CLOCK_MONOTONIC stands still then, so a bridge would wake up with the remaining `hold` and drive on. Capture
times of media stay on CLOCK_MONOTONIC, which cameras stamp with; the two are never compared.
"""

import sys
import time
from collections.abc import Callable

__all__ = ["Clock", "now"]

Clock = Callable[[], float]

if sys.platform == "linux":

    def now() -> float:
        """Return the time in seconds from a monotonic clock that includes suspended time."""
        return time.clock_gettime(time.CLOCK_BOOTTIME)

else:

    def now() -> float:
        """Return the time in seconds from a monotonic clock; here none surely includes suspended time."""
        return time.monotonic()
