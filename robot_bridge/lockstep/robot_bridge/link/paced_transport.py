"""Reads a link no faster than its share of the thread's time allows: further data waits at its source.

One event loop of a console serves many robots and all their operators. A bridge that sends data without end takes half
of the loop's time at most with its two links, in turns of a millisecond or two.
"""

import asyncio
import time
from collections import deque
from collections.abc import Callable

from lockstep.robot_bridge.link.link_session import LinkSession
from lockstep.robot_bridge.link.link_transport import LinkTransport

__all__ = ["PIECE", "READ_BURST", "READ_SHARE", "READ_TURN", "PacedTransport", "ReadBudget"]

READ_SHARE = 0.25  # of the thread's time
READ_BURST = 0.1  # s of the thread's time at once
READ_TURN = 0.001  # s of the thread's time in one turn of the loop
LONG_TURN = 0.01  # s of a turn that are made up for; a longer turn was another process' time
PIECE = 4 << 10  # bytes between two looks at the time; a thousand of the shortest messages


class ReadBudget:
    """Bounds the time for which a connection may make a thread work. No I/O, no clock; the caller hands in times in s.

    `worked` is the thread's own time: its waiting for a processor is not the connection's doing.
    """

    def __init__(self, share: float, burst: float, now: float) -> None:
        self._share = share
        self._burst = burst
        self._left = burst
        self._at = now

    def spend(self, worked: float, now: float) -> float:
        """Account for the seconds spent on received data; returns the seconds until the next read, 0 for now."""
        self._left = min(self._burst, self._left + (now - self._at) * self._share) - worked
        self._at = now
        return max(0.0, -self._left / self._share)


class PacedTransport(LinkTransport):
    """`worked`: returns the time that this thread has worked so far, s."""

    def __init__(
        self,
        session: LinkSession,
        clock: Callable[[], float] = time.monotonic,
        worked: Callable[[], float] = time.thread_time,
    ) -> None:
        super().__init__(session, clock)
        self._worked = worked
        self._budget = ReadBudget(READ_SHARE, READ_BURST, clock())
        self._unread: deque[memoryview] = deque()
        self._later: asyncio.TimerHandle | None = None  # the call that reads on; None while everything is read

    def data_received(self, data: bytes) -> None:
        self._unread.append(memoryview(data))
        if self._later is None:
            self._read()

    def _read(self) -> None:
        self._later = None
        since, began = self._clock(), self._worked()
        now = began
        while self._unread and now - began < READ_TURN:
            super().data_received(self._next_piece())
            now = self._worked()
        ended = self._clock()
        wait = self._budget.spend(now - began, ended)
        if self._transport is None:
            return
        if self._unread:  # a flood: others come first, even if the thread gets little of its processor
            wait = max(wait, min(ended - since, LONG_TURN) * (1 / READ_SHARE - 1))
        if self._unread or wait > 0:
            self._transport.pause_reading()
            self._later = asyncio.get_running_loop().call_later(wait, self._read)
        else:
            self._transport.resume_reading()

    def _next_piece(self) -> bytes:
        """Return the next piece, or all that is there of a large message: reading it costs no more than copying it."""
        first = self._unread.popleft()
        end = max(PIECE, self.session.missing)
        if len(first) > end:
            self._unread.appendleft(first[end:])
        return bytes(first[:end])

    def connection_lost(self, error: Exception | None) -> None:
        if self._later is not None:
            self._later.cancel()
            self._later = None
        self._unread.clear()
        super().connection_lost(error)
