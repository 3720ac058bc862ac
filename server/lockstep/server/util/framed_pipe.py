"""Messages through a pipe to or from a worker process: 4 bytes of length, then MessagePack."""

import asyncio
import struct
from typing import Any, BinaryIO, Generic, TypeVar

import msgspec

__all__ = ["FramedPipe"]

Message = TypeVar("Message")
LENGTH = struct.Struct("!I")


class FramedPipe(Generic[Message]):
    """Writes and reads the messages of one pipe. `max_length`: of a message, in bytes."""

    def __init__(self, kind: Any, max_length: int) -> None:
        """`kind`: the type of the messages, or a union of types."""
        self._max_length = max_length
        self._encoder = msgspec.msgpack.Encoder()
        self._decoder: msgspec.msgpack.Decoder[Message] = msgspec.msgpack.Decoder(kind)

    def encode(self, message: Message) -> bytes:
        data = self._encoder.encode(message)
        return LENGTH.pack(len(data)) + data

    def write(self, file: BinaryIO, message: Message) -> None:
        file.write(self.encode(message))
        file.flush()

    def read(self, file: BinaryIO) -> Message | None:
        """Read the next message; None when the other side has ended, or the message is not valid."""
        head = file.read(LENGTH.size)
        length = self._length(head) if len(head) == LENGTH.size else None
        if length is None:
            return None
        data = file.read(length)
        return self._decode(data) if len(data) == length else None

    async def receive(self, reader: asyncio.StreamReader) -> Message | None:
        """Read as `read` does, without a thread."""
        try:
            length = self._length(await reader.readexactly(LENGTH.size))
            return None if length is None else self._decode(await reader.readexactly(length))
        except (asyncio.IncompleteReadError, ConnectionError):
            return None

    def _length(self, head: bytes) -> int | None:
        (length,) = LENGTH.unpack(head)
        return length if length <= self._max_length else None

    def _decode(self, data: bytes) -> Message | None:
        try:
            return self._decoder.decode(data)
        except msgspec.DecodeError:
            return None
