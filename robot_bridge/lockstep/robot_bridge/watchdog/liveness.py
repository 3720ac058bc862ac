"""Ends the process when its control ticks have stopped for good, so that its service manager starts it again.

By then the watchdog has long brought the robot to rest (`watchdogs.py`). A thread ends the process with a message; the
kernel's alarm does where that thread cannot run, because native code keeps the interpreter's lock, or cannot write.
"""

import faulthandler
import logging
import os
import signal
import threading
import time
from collections.abc import Callable
from contextlib import suppress

from lockstep.robot_bridge.service_manager import ServiceManager
from lockstep.robot_bridge.thread_name import name_thread

__all__ = ["EXIT_HUNG", "LIMIT", "Liveness"]

EXIT_HUNG = 3
LIMIT = 10.0  # s; every tick of an adapter that still works is shorter
ALARM = 1.5  # of the limit, until the alarm
BEAT = 1.0  # s between two signs of life, at most
PER_LIMIT = 5  # signs of life in each limit, at least

_logger = logging.getLogger(__name__)


class Liveness:
    """Ends a hanging process. Without arguments it does nothing.

    The process must be the bridge's alone. Call `start` in the main thread, `ticked` at every tick, then `close`.
    """

    def __init__(self, limit: float | None = None, service: ServiceManager | None = None) -> None:
        """`limit`: s without a tick after which the process ends; None: it never does. Suspended time is not counted.

        `service`: told at every sign of life, so that it is told nothing while the ticks stand still.
        """
        self._limit = limit
        self._service = service or ServiceManager({})
        limits = (limit, self._service.watchdog_seconds)
        self._beat = min([BEAT, *(each / PER_LIMIT for each in limits if each is not None)])
        self._last = time.monotonic()
        self._note: Callable[[str], None] = lambda reason: None
        self._armed = False  # the alarm is set
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._run, name="liveness", daemon=True)

    def start(self, note: Callable[[str], None]) -> None:
        """Start with the ticks. `note`: keeps the reason for the next start; called in another thread if they stop."""
        self._last = time.monotonic()
        self._note = note
        if self._limit is not None:
            signal.signal(signal.SIGALRM, signal.SIG_DFL)  # ends the process without a line of Python
            signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGALRM])
            self._armed = True
            self._wind_up()
            self._thread.start()
        self._service.ready()

    def ticked(self) -> None:
        """Note that a tick has ended, or a step on the way out. Cheap."""
        now = time.monotonic()
        if now - self._last < self._beat:
            return
        self._last = now
        self._wind_up()
        self._service.alive()

    def leaving(self) -> None:
        """Note that the process is about to end, for which it has the time of the limit."""
        self._service.stopping()
        self._last = time.monotonic()
        self._wind_up()

    def close(self) -> None:
        """Note that the ticks have ended in order. The alarm stays: the rest of the exit may hang too. Idempotent."""
        self._closed.set()
        if self._thread.is_alive():
            self._thread.join(BEAT)
        self._wind_up()
        self._service.close()

    def _wind_up(self) -> None:
        if self._armed and self._limit is not None:
            signal.setitimer(signal.ITIMER_REAL, ALARM * self._limit)

    def _run(self) -> None:
        assert self._limit is not None  # else the thread is not started
        name_thread("liveness")
        while (left := self._last + self._limit - time.monotonic()) > 0:
            if self._closed.wait(left):
                return
        try:
            self._end(f"The robot bridge hung: no control tick for {self._limit:g} s")
        finally:
            os._exit(EXIT_HUNG)

    def _end(self, reason: str) -> None:
        """End the process. Each call here may block or raise; then the alarm ends the process."""
        with suppress(Exception):
            self._note(reason)
        _logger.critical("%s. The bridge ends, so that it can be started again; the stacks of all threads:", reason)
        faulthandler.dump_traceback(all_threads=True)
