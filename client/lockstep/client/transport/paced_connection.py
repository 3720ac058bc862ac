"""A WebSocket whose frames are parsed in small pieces, so that a peer that floods it holds up nobody else on the loop.

websockets parses all that it has received at once: a single read holds a hundred thousand empty frames or pings, which
take the loop half a second.
"""

import asyncio
from typing import Final, cast

from websockets.asyncio.client import ClientConnection
from websockets.client import ClientProtocol

from lockstep.protocol.pacing.paced_reader import PacedReader
from lockstep.protocol.pacing.paced_socket import PacedSocket

__all__ = ["MAX_UNSENT", "PacedConnection"]

MAX_UNSENT: Final = 256 * 1024  # bytes that wait to leave; a peer that pings and reads no answer would add to them


class PacedConnection(ClientConnection):
    """Parses within a quarter of the thread's time, a millisecond at once; the socket is not read meanwhile."""

    def __init__(self, protocol: ClientProtocol, **options: object) -> None:
        super().__init__(protocol, **options)  # type: ignore[arg-type]
        self._reader = PacedReader(self._parse)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        super().connection_made(PacedSocket(cast(asyncio.Transport, transport), self._reader))

    def data_received(self, data: bytes) -> None:
        self._reader.feed(data)

    def eof_received(self) -> None:
        self._reader.end()  # nothing more may come behind the end
        super().eof_received()

    def connection_lost(self, exc: Exception | None) -> None:
        self._reader.end()
        super().connection_lost(exc)

    def _parse(self, data: bytes) -> None:
        super().data_received(data)
        if self.transport.get_write_buffer_size() > MAX_UNSENT:
            self.transport.abort()
