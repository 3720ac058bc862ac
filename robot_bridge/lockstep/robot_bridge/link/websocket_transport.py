"""A robot link's transport on a WebSocket: the same framed bytes, as binary messages cut anywhere (RFC 6455)."""

import asyncio
from collections.abc import Iterable
from typing import Any

from websockets.protocol import Protocol, State

__all__ = ["CHUNK", "WebSocketTransport"]

CHUNK = 32 << 10  # bytes of one WebSocket message; a console takes at most 64 KiB in one
GOING_AWAY = 1001  # RFC 6455 7.4.1


class WebSocketTransport(asyncio.Transport):
    """What a `LinkTransport` writes to. The connection below it hands received messages to `LinkTransport`."""

    def __init__(self, tcp: asyncio.Transport, frames: Protocol) -> None:
        """`frames`: the open WebSocket, without I/O."""
        super().__init__()
        self._tcp = tcp
        self._frames = frames

    def get_extra_info(self, name: str, default: Any = None) -> Any:
        return self._tcp.get_extra_info(name, default)

    def is_closing(self) -> bool:
        return self._tcp.is_closing()

    def write(self, data: bytes | bytearray | memoryview) -> None:
        """Send these bytes; discarded after the end, as by every transport."""
        if self._frames.state is not State.OPEN or self._tcp.is_closing():
            return
        view = memoryview(data)
        for at in range(0, len(view), CHUNK):
            self._frames.send_binary(bytes(view[at : at + CHUNK]))
        self._flush()

    def writelines(self, list_of_data: Iterable[bytes | bytearray | memoryview]) -> None:
        self.write(b"".join(list_of_data))

    def close(self) -> None:
        if self._frames.state is State.OPEN and not self._tcp.is_closing():
            self._frames.send_close(GOING_AWAY)
            self._flush()
        self._tcp.close()

    def abort(self) -> None:
        self._tcp.abort()

    def pause_reading(self) -> None:
        if not self._tcp.is_closing():
            self._tcp.pause_reading()

    def resume_reading(self) -> None:
        if not self._tcp.is_closing():
            self._tcp.resume_reading()

    def set_write_buffer_limits(self, high: int | None = None, low: int | None = None) -> None:
        self._tcp.set_write_buffer_limits(high, low)

    def get_write_buffer_size(self) -> int:
        return self._tcp.get_write_buffer_size()

    def _flush(self) -> None:
        data = b"".join(self._frames.data_to_send())
        if data:
            self._tcp.write(data)
