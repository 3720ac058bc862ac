"""The heartbeats of one connection, on the side of a case."""

import asyncio
from collections.abc import Callable

from lockstep.protocol.messages import LinkMessage, Ping, Pong

__all__ = ["Heartbeat"]

PING_INTERVAL = 0.2  # s


class Heartbeat:
    """Pings at intervals from `begin` to `stop`, and answers pings.

    Attributes:
        beats: False: neither pings nor pongs, so that the bridge should take this side for dead
        pings: the number of pings that came
    """

    def __init__(self, send: Callable[[LinkMessage], None]) -> None:
        self.beats = True
        self.pings = 0
        self._send = send
        self._timer: asyncio.TimerHandle | None = None
        self._pinged = 0  # id of the newest ping of this side

    def begin(self) -> None:
        """Begin to ping, if it has not begun."""
        if self._timer is None:
            self._ping()

    def stop(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._timer = None

    def take(self, message: LinkMessage) -> bool:
        """Take a message that came. True if it was a ping, or the pong to a ping of this side."""
        if isinstance(message, Ping):
            self.pings += 1
            if self.beats:
                self._send(Pong(id=message.id))
            return True
        return isinstance(message, Pong) and 0 < message.id <= self._pinged

    def _ping(self) -> None:
        if self.beats:
            self._pinged += 1
            self._send(Ping(id=self._pinged))
        self._timer = asyncio.get_running_loop().call_later(PING_INTERVAL, self._ping)
