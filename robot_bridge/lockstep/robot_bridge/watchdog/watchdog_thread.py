"""Brings a robot to rest from a separate thread when the event loop is held up."""

import logging
import threading
from collections.abc import Callable

from lockstep.robot_bridge.control import clock
from lockstep.robot_bridge.thread_name import name_thread

__all__ = ["WatchdogThread"]

JOIN_SECONDS = 1.0

_logger = logging.getLogger(__name__)


class WatchdogThread:
    """Calls `act` when the last tick is `limit` seconds old and the robot moved, and again every `limit` seconds.

    The thread needs Python's interpreter lock: native code that blocks without releasing it holds up this thread too.
    """

    def __init__(self, limit: float, act: Callable[[], None], now: clock.Clock = clock.now) -> None:
        self._limit = limit
        self._act = act
        self._now = now
        self._last = now()
        self._moving = False
        self._acted = False
        self._closed = False
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._run, name="watchdog", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def ticked(self, now: float, moving: bool) -> None:
        """Note that a tick begins; `moving`: its values are not at rest. Cheap: the thread does the check."""
        self._last = now
        if moving and not self._moving:
            self._moving = True
            with self._changed:
                self._changed.notify()
        self._moving = moving

    def take_acted(self) -> bool:
        """Return whether the watchdog has acted since the last call."""
        acted, self._acted = self._acted, False
        return acted

    def close(self) -> None:
        """End the thread; waits shortly for a call of `act` that goes on. May be called again."""
        with self._changed:
            self._closed = True
            self._changed.notify()
        if self._thread.is_alive():
            self._thread.join(JOIN_SECONDS)

    def _run(self) -> None:
        name_thread("watchdog")
        while True:
            with self._changed:
                if self._closed:
                    return
                left = self._limit - (self._now() - self._last) if self._moving else None
                if left is None or left > 0:
                    self._changed.wait(left)
                    continue
            self._bring_to_rest()
            with self._changed:
                if not self._closed:
                    self._changed.wait(self._limit)

    def _bring_to_rest(self) -> None:
        if not self._acted:
            _logger.error("no tick for %.3f s: the watchdog thread brings the robot to rest", self._now() - self._last)
        self._acted = True  # before the call: a call that ended half-way counts too
        try:
            self._act()
        except BaseException as error:  # the thread lives on and tries again
            _logger.critical("the watchdog thread cannot bring the robot to rest: %r", error)
