"""Ticks a client's session in time to ask for an answer that is due."""

import asyncio
import time
from collections.abc import Callable

from lockstep.protocol.messages import LinkMessage
from lockstep.robot_bridge.link.link_session import ClientSession

__all__ = ["AskTimer"]

SHORTEST = 0.001  # s; a timer may come a little early


class AskTimer:
    """Call `sent` with every message, and `cancel` at the end."""

    def __init__(self, session: ClientSession, tick: Callable[[], None]) -> None:
        """`tick`: ticks the session and sends what it says."""
        self._session = session
        self._tick = tick
        self._timer: asyncio.TimerHandle | None = None
        self._at = 0.0  # s, when it passes

    def sent(self, message: LinkMessage) -> None:
        self._session.sent(message, time.monotonic())
        at = self._session.asks_at
        if at is not None and (self._timer is None or at < self._at):
            self.cancel()
            self._set(at)

    def cancel(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _set(self, at: float) -> None:
        self._at = at
        self._timer = asyncio.get_running_loop().call_later(max(SHORTEST, at - time.monotonic()), self._passed)

    def _passed(self) -> None:
        """Tick, unless the answer has come meanwhile; another may be due later."""
        self._timer = None
        if self._session.asks_at is not None and time.monotonic() >= self._session.asks_at:
            self._tick()
        if self._session.asks_at is not None:
            self._set(self._session.asks_at)
