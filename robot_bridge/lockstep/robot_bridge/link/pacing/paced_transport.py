"""The robot link over TCP, read no faster than its share of the thread's time allows."""

import asyncio
import time
from collections.abc import Callable
from typing import cast

from lockstep.protocol.pacing.paced_reader import PacedReader
from lockstep.robot_bridge.link.link_session import LinkSession
from lockstep.robot_bridge.link.link_transport import LinkTransport

__all__ = ["PacedTransport"]


class PacedTransport(LinkTransport):
    """`worked`: returns the time that this thread has worked so far, s."""

    def __init__(
        self,
        session: LinkSession,
        clock: Callable[[], float] = time.monotonic,
        worked: Callable[[], float] = time.thread_time,
    ) -> None:
        super().__init__(session, clock)
        self._reader = PacedReader(
            super().data_received, missing=lambda: self.session.missing, clock=clock, worked=worked
        )

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._reader.begin(cast(asyncio.ReadTransport, transport))
        super().connection_made(transport)

    def data_received(self, data: bytes) -> None:
        self._reader.feed(data)

    def connection_lost(self, error: Exception | None) -> None:
        self._reader.end()
        super().connection_lost(error)
