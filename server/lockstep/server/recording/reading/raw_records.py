"""Reads the records of an MCAP file in file order, without any index, and those in a chunk."""

import os
import struct
from collections.abc import Iterator
from typing import BinaryIO, NamedTuple

from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Chunk, McapRecord, Message, MessageIndex
from mcap.stream_reader import CRCValidationError, breakup_chunk, get_chunk_data_stream
from zstandard import ZstdError, frame_content_size

from lockstep.server.recording.errors import RecordingDamaged

__all__ = [
    "BROKEN",
    "HEAD",
    "MAGIC",
    "MAX_RECORD",
    "MAX_UNPACKED",
    "RawRecord",
    "check_packed",
    "chunk_records",
    "message_indexes",
    "raw_records",
]

MAGIC = b"\x89MCAP0\r\n"
HEAD = 9  # bytes of opcode and length
MAX_RECORD = 256 * 1024 * 1024  # bytes; the index of a long recording is the largest
MAX_UNPACKED = 32 * 1024 * 1024  # bytes, of a chunk; Lockstep writes at most one megabyte and one picture

# The errors that the mcap library raises for malformed bytes.
BROKEN = (McapError, CRCValidationError, ZstdError, struct.error, ValueError, KeyError, EOFError, RuntimeError)


class RawRecord(NamedTuple):
    opcode: int
    offset: int
    content: bytes

    @property
    def end(self) -> int:
        return self.offset + HEAD + len(self.content)


def raw_records(file: BinaryIO) -> Iterator[RawRecord]:
    """Yield the whole records from the file's position on. Raises RecordingDamaged when one is too large."""
    size = os.fstat(file.fileno()).st_size
    while True:
        offset = file.tell()
        head = file.read(HEAD)
        length = int.from_bytes(head[1:], "little")
        if len(head) < HEAD or offset + HEAD + length > size:
            return
        if length > MAX_RECORD:  # a sparse file may be as long as it says without taking room on the disk
            raise RecordingDamaged(f"a record of {length} bytes at byte {offset}, the bound is {MAX_RECORD}")
        yield RawRecord(head[0], offset, file.read(length))


def check_packed(chunk: Chunk) -> None:
    """Check that a chunk may be unpacked: no few bytes that would become more than fits in memory, and no lz4.

    Raises ValueError.
    """
    if chunk.compression not in ("", "zstd"):
        raise ValueError(f"compressed as {chunk.compression!r}")
    unpacked = frame_content_size(chunk.data) if chunk.compression else len(chunk.data)
    if unpacked != chunk.uncompressed_size or unpacked > MAX_UNPACKED:
        raise ValueError(f"a chunk of {chunk.uncompressed_size} bytes, or {unpacked}")


def chunk_records(chunk: Chunk) -> list[McapRecord]:
    """Return the records in a chunk. Raises one of BROKEN."""
    check_packed(chunk)
    return breakup_chunk(chunk, validate_crc=True)


def message_indexes(chunk: Chunk) -> list[MessageIndex]:
    """Return what stands behind a chunk (MCAP specification, "Message Index"). Raises one of BROKEN."""
    check_packed(chunk)
    stream, length = get_chunk_data_stream(chunk, validate_crc=True)
    found: dict[int, MessageIndex] = {}
    while stream.count < length:
        at = stream.count
        opcode, size = stream.read1(), stream.read8()
        if opcode != Opcode.MESSAGE:
            stream.read(size)
            continue
        message = Message.read(stream, size)
        found.setdefault(message.channel_id, MessageIndex(message.channel_id, [])).records.append(
            (message.log_time, at)
        )
    return list(found.values())
