"""Calls `handle_timer` of a peer when it is due."""

import asyncio
from collections.abc import Callable

from lockstep.rtc.peer import Peer

__all__ = ["PeerTimer"]

CLOCK_RESOLUTION = 0.001  # s; a loop may call too early by so much


class PeerTimer:
    """One timer of the loop. One that fires too early is left: the next datagram puts off most of them, and no code
    waits for them."""

    def __init__(self, peer: Peer, handled: Callable[[], None], failed: Callable[[Exception], None]) -> None:
        """`handled`: called when the peer has handled its timer. `failed`: called with an exception of the peer."""
        self._peer = peer
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
        due = self._peer.timer()
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
        due, now = self._peer.timer(), self._loop.time()
        if due is None or due > now + CLOCK_RESOLUTION:
            self.set()
            return
        try:
            self._peer.handle_timer(max(now, due))
        except Exception as error:
            self._failed(error)
        self._handled()

    def close(self) -> None:
        self._is_closed = True
        if self._handle is not None:
            self._handle.cancel()
