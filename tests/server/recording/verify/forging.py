"""Files that somebody changed who can make every checksum fit."""

import zlib
from collections.abc import Callable
from pathlib import Path

from mcap.opcode import Opcode

from lockstep.server.recording.reading.raw_records import MAGIC, RawRecord, raw_records

__all__ = ["remade"]


def remade(path: Path, further: list[RawRecord], change: Callable[[RawRecord], RawRecord] = lambda raw: raw) -> None:
    """Other records of the same length, and `further` ones at the end of the data.

    Offsets and checksum of the summary are made to fit by who has no key.
    """

    def written(records: list[RawRecord]) -> bytes:
        return b"".join(bytes([raw.opcode]) + len(raw.content).to_bytes(8, "little") + raw.content for raw in records)

    def moved(offset: bytes) -> bytes:
        return (int.from_bytes(offset, "little") + len(written(further))).to_bytes(8, "little")

    with path.open("rb") as file:
        file.seek(len(MAGIC))
        *records, footer = raw_records(file)
    records = [change(raw) for raw in records]
    end = next(number for number, raw in enumerate(records) if raw.opcode == Opcode.DATA_END)
    summary = [
        raw._replace(content=raw.content[:1] + moved(raw.content[1:9]) + raw.content[9:])
        if raw.opcode == Opcode.SUMMARY_OFFSET
        else raw
        for raw in records[end + 1 :]
    ]
    last = footer._replace(content=moved(footer.content[:8]) + moved(footer.content[8:16]) + footer.content[16:])
    checked = written([*summary, last])[:-4]
    front = written([*records[:end], *further, records[end]])
    path.write_bytes(MAGIC + front + checked + zlib.crc32(checked).to_bytes(4, "little") + MAGIC)
