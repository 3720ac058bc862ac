"""Reads the messages of a WebSocket in turns, so that a peer that sends without end holds up nobody else on the loop.

Messages are handled for half of the loop's time at most, and at most `MOST` in a row. What is not read waits: at most
`MAX_UNREAD` messages, those of one more piece that `PacedConnection` parses, and one read of the socket; then TCP lets
the peer send no more.
"""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from typing import Final

__all__ = ["MAX_UNREAD", "MOST", "MessageTurns", "in_turns"]

MAX_UNREAD: Final = 16  # messages, from which on the socket is not read
MOST: Final = 64  # messages in a row
TURN: Final = 0.005  # s of handling in a row


class MessageTurns:
    """Says after each message how long the reader has to wait. No I/O: `now` is passed in, s."""

    def __init__(self, now: float) -> None:
        self._debt = 0.0  # s of handling that were not followed by as much waiting
        self._count = 0  # messages in a row
        self._handled_at = now

    def handled(self, began: float, now: float) -> float | None:
        """Note a message; return the s to wait, 0 to let the others run once; None: read on."""
        waited = began - self._handled_at
        self._handled_at = now
        self._debt = max(0.0, self._debt - waited) + now - began
        self._count += 1
        if self._debt < TURN and self._count < MOST:
            return None
        self._count = 0
        return self._debt if self._debt >= TURN else 0.0


async def in_turns(receive: Callable[[], Awaitable[str | bytes]]) -> AsyncIterator[str | bytes]:
    """Yield what `receive` returns, until it raises. A message counts as handled when the next one is asked for."""
    clock = asyncio.get_running_loop().time
    turns = MessageTurns(clock())
    while True:
        data = await receive()
        began = clock()
        yield data
        pause = turns.handled(began, clock())
        if pause is not None:
            await asyncio.sleep(pause)
