"""Reads a connection no faster than its share of the thread's time allows: further data waits at its source.

One event loop of a console serves many robots and all their operators. A bridge that sends data without end takes half
of the loop's time at most with its two links, in turns of a millisecond or two. That holds for all that its data cost:
on a WebSocket the frames too, in which the link's messages come.
"""

import asyncio
import time
from collections import deque
from collections.abc import Callable
from typing import Protocol, cast

__all__ = [
    "PIECE",
    "READ_BURST",
    "READ_SHARE",
    "READ_TURN",
    "PacedReader",
    "ReadBudget",
    "Turns",
]

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


class Turns(Protocol):
    """Bounds what several readers take of the thread's time together."""

    @property
    def is_free(self) -> bool:
        """True if a reader may read at once."""
        ...

    def ask(self, read: Callable[[], None]) -> None:
        """Call `read` in its turn, not before this returns."""
        ...

    def leave(self, read: Callable[[], None]) -> None: ...

    def spend(self, worked: float) -> None:
        """Account for the seconds of the thread's time that a reader has just taken."""
        ...


class PacedReader:
    """Hands received data on in pieces, within a budget of the thread's time.

    Its transport is paused while data wait here, so no more than one read of it does. Whoever takes the data may pause
    the reader too.
    """

    def __init__(
        self,
        take: Callable[[bytes], None],
        *,
        share: float = READ_SHARE,
        burst: float = READ_BURST,
        missing: Callable[[], int] = lambda: 0,
        turns: Turns | None = None,
        clock: Callable[[], float] = time.monotonic,
        worked: Callable[[], float] = time.thread_time,
    ) -> None:
        """Make a reader that reads once `begin` was called.

        Args:
            take: gets each piece
            share: of the thread's time
            burst: s of the thread's time at once
            missing: returns the bytes of a large message that are still to come; they may be one piece
            turns: shared with other readers, beside the budget of this one
            worked: returns the time that this thread has worked so far, s
        """
        self._take = take
        self._share = share
        self._missing = missing
        self._turns = turns
        self._clock = clock
        self._worked = worked
        self._budget = ReadBudget(share, burst, clock())
        self._unread: deque[memoryview] = deque()
        self._source: asyncio.ReadTransport | None = None  # None before the connection and after it
        self._later: asyncio.Handle | None = None  # the call that reads on; None while everything is read, or paused
        self._waits = False  # for its turn
        self._paused = False  # by whoever takes the data
        self._reading = False

    def allow(self, share: float, burst: float) -> None:
        """Take another budget from now on, of this reader alone."""
        if self._turns is not None and self._waits:
            self._turns.leave(self._read_in_turn)
            self._waits = False
            self._later = asyncio.get_running_loop().call_soon(self._go_on)
        self._turns = None
        self._share = share
        self._budget = ReadBudget(share, burst, self._clock())

    def begin(self, source: asyncio.ReadTransport) -> None:
        self._source = source

    def end(self) -> None:
        """Drop all data, now and from now on."""
        if self._later is not None:
            self._later.cancel()
            self._later = None
        if self._turns is not None and self._waits:
            self._turns.leave(self._read_in_turn)
        self._waits = False
        self._unread.clear()
        self._source = None

    def feed(self, data: bytes) -> None:
        """Take received data; hand on at once what there is time for."""
        if self._source is None:
            return
        self._unread.append(memoryview(data))
        if self._is_idle and not self._paused:
            self._go_on()
        else:
            self._source.pause_reading()  # somebody else had resumed it

    def pause_reading(self) -> None:
        self._paused = True
        if self._source is not None:
            self._source.pause_reading()

    def resume_reading(self) -> None:
        if not self._paused:
            return
        self._paused = False
        if self._source is None or not self._is_idle:
            return
        if self._unread:
            self._later = asyncio.get_running_loop().call_soon(self._go_on)
        else:
            self._source.resume_reading()

    @property
    def _is_idle(self) -> bool:
        return self._later is None and not self._waits and not self._reading

    def _go_on(self) -> None:
        """Read as soon as the other readers let it."""
        self._later = None
        if self._turns is None or self._turns.is_free or not self._unread:
            self._read()
        elif self._source is not None:
            self._waits = True
            self._source.pause_reading()
            self._turns.ask(self._read_in_turn)

    def _read_in_turn(self) -> None:
        self._waits = False
        self._read()

    def _read(self) -> None:
        if self._paused:
            return  # the budget was used up meanwhile; `resume_reading` goes on
        since, began = self._clock(), self._worked()
        try:
            worked = self._hand_on(began)
        except BaseException:
            self._give_up()
            raise
        ended = self._clock()
        wait = self._budget.spend(worked, ended)
        if self._turns is not None:
            self._turns.spend(worked)
        if self._source is None:
            return
        if self._unread and not self._paused:
            # A flood: others come first, even if the thread gets little of its processor.
            wait = max(wait, min(ended - since, LONG_TURN) * (1 / self._share - 1))
        if wait > 0 or (self._unread and not self._paused):
            self._later = asyncio.get_running_loop().call_later(wait, self._go_on)
        if self._later is not None or self._paused:
            self._source.pause_reading()
        else:
            self._source.resume_reading()

    def _give_up(self) -> None:
        """Abort the connection after a fault: in a turn of the loop's own, nobody else would, and it stays paused."""
        source = cast(asyncio.Transport | None, self._source)
        self.end()
        if source is not None:
            source.abort()

    def _hand_on(self, began: float) -> float:
        """Hand on pieces for a turn; return the seconds of the thread's time that it took."""
        self._reading = True
        now = began
        try:
            while self._unread and not self._paused and now - began < READ_TURN:
                self._take(self._next_piece())
                now = self._worked()
        finally:
            self._reading = False
        return now - began

    def _next_piece(self) -> bytes:
        """Return the next piece, or all that is there of a large message: reading it costs no more than copying it."""
        first = self._unread.popleft()
        end = max(PIECE, self._missing())
        if len(first) > end:
            self._unread.appendleft(first[end:])
        return bytes(first[:end])
