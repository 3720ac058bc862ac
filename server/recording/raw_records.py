"""The records of an MCAP file in the order in which they lie there, without any index."""

import os
import struct
from collections.abc import Iterator
from typing import BinaryIO, NamedTuple

from mcap.exceptions import McapError
from mcap.stream_reader import CRCValidationError
from zstandard import ZstdError

__all__ = ["BROKEN", "HEAD", "MAGIC", "RawRecord", "raw_records"]

MAGIC = b"\x89MCAP0\r\n"
HEAD = 9  # bytes of opcode and length

# What the mcap library raises where bytes are not what they should be.
BROKEN = (McapError, CRCValidationError, ZstdError, struct.error, ValueError, KeyError, EOFError, RuntimeError)


class RawRecord(NamedTuple):
    opcode: int
    offset: int
    content: bytes

    @property
    def end(self) -> int:
        return self.offset + HEAD + len(self.content)


def raw_records(file: BinaryIO) -> Iterator[RawRecord]:
    """From where `file` stands on, as far as they are whole."""
    size = os.fstat(file.fileno()).st_size
    while True:
        offset = file.tell()
        head = file.read(HEAD)
        length = int.from_bytes(head[1:], "little")
        if len(head) < HEAD or offset + HEAD + length > size:
            return
        yield RawRecord(head[0], offset, file.read(length))
