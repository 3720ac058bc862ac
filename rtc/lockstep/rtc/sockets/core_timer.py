"""Calls `handle_timer` of a core when it is due."""

import asyncio
from collections.abc import Callable
from typing import Protocol

__all__ = ["CoreTimer"]

CLOCK_RESOLUTION = 0.001  # s; a loop may call too early by so much


class _Core(Protocol):
    """What lives by a timer, without I/O."""

    def timer(self) -> float | None: ...

    def handle_timer(self, now: float) -> None: ...


class CoreTimer:
    """One timer of the loop. One that fires too early is left: the next datagram puts off most of them, and no code
    waits for them. One that is due is never put off: on a busy machine each turn of the loop has a datagram, which the
    loop takes first."""

    def __init__(self, core: _Core, handled: Callable[[], None], failed: Callable[[Exception], None]) -> None:
        """`handled`: called when the core has handled its timer. `failed`: called with an exception of the core."""
        self._core = core
        self._handled = handled
        self._failed = failed
        self._loop = asyncio.get_running_loop()
        self._handle: asyncio.TimerHandle | None = None
        self._at = 0.0
        self._is_set_soon = False  # True: the loop calls `_set_now` in its next turn
        self._is_closed = False

    def set_soon(self) -> None:
        """Set it behind everything that this turn of the loop has woken, which may wait for a feedback."""
        if not self._is_set_soon:
            self._is_set_soon = True
            self._loop.call_soon(self._set_now)

    def _set_now(self) -> None:
        self._is_set_soon = False
        if not self._is_closed:
            try:
                self.set()
            except Exception as error:
                self._failed(error)

    def set(self) -> None:
        """Set it anew."""
        due = self._core.timer()
        if due is None and self._handle is not None:
            self._handle.cancel()
            self._handle = None
        self.set_by(due)

    def set_by(self, due: float | None) -> None:
        """Let it fire at `due` at the latest."""
        if due is None or (self._handle is not None and self._at <= due):
            return
        if self._handle is not None:
            self._handle.cancel()
        self._handle, self._at = self._loop.call_at(due, self._due), due

    def _due(self) -> None:
        self._handle = None
        due, now = self._core.timer(), self._loop.time()
        if due is None or due > now + CLOCK_RESOLUTION:
            self.set()
            return
        try:
            self._core.handle_timer(max(now, due))
        except Exception as error:
            self._failed(error)
        self._handled()

    def close(self) -> None:
        self._is_closed = True
        if self._handle is not None:
            self._handle.cancel()
