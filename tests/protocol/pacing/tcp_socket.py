"""A TCP connection that counts how often its reading was paused."""

import asyncio

__all__ = ["Socket"]


class Socket(asyncio.Transport):
    def __init__(self) -> None:
        super().__init__()
        self.pauses = 0

    def write(self, data: bytes | bytearray | memoryview) -> None: ...
    def set_write_buffer_limits(self, high: int | None = None, low: int | None = None) -> None: ...
    def close(self) -> None: ...
    def abort(self) -> None: ...

    def pause_reading(self) -> None:
        self.pauses += 1

    def resume_reading(self) -> None: ...

    def was_paused(self) -> bool:
        return self.pauses > 0
