"""Reads the records of an MCAP file by their offsets: its metadata, its chunks and its attachments."""

from io import BytesIO
from pathlib import Path

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, AttachmentIndex, Chunk, Footer, Metadata

from lockstep.protocol.files.regular_file import open_regular
from lockstep.server.recording.errors import RecordingDamaged
from lockstep.server.recording.reading.raw_records import HEAD, MAGIC, MAX_RECORD

__all__ = ["FOOTER", "RecordFile"]

FOOTER = HEAD + 20 + len(MAGIC)  # bytes


class RecordFile:
    """An open file; close it.

    Raises:
        RecordingDamaged or one of BROKEN: by all that read a record.
        OSError: it cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file = open_regular(path)

    def close(self) -> None:
        self._file.close()

    def metadata(self) -> Metadata:
        """Return the metadata behind the header."""
        self._file.seek(0)
        if self._file.read(len(MAGIC)) != MAGIC:
            raise RecordingDamaged(f"{self._path.name} is not an MCAP file")
        header = self._file.read(HEAD)
        offset = len(MAGIC) + HEAD + int.from_bytes(header[1:], "little")
        found: Metadata = Metadata.read(self._record(offset, Opcode.METADATA))
        return found

    def chunk(self, offset: int) -> Chunk:
        """Return the chunk at `offset`."""
        found: Chunk = Chunk.read(self._record(offset, Opcode.CHUNK))
        return found

    def attachment(self, name: str) -> bytes | None:
        """Return the first attachment if it has that name; None: it has not, or the file was not closed."""
        end = self._file.seek(0, 2)
        if end < FOOTER:
            return None
        self._file.seek(end - len(MAGIC))
        if self._file.read() != MAGIC:
            return None
        footer = Footer.read(self._record(end - FOOTER, Opcode.FOOTER))
        entry = self._attachment_index(footer, end)
        if entry is None or entry.name != name:
            return None
        data: bytes = Attachment.read(self._record(entry.offset, Opcode.ATTACHMENT)).data
        return data

    def _attachment_index(self, footer: Footer, end: int) -> AttachmentIndex | None:
        """Find the first one. The summary's last groups are short, so they are read from their own beginning."""
        self._seek(footer.summary_offset_start or footer.summary_start)
        length = end - self._file.tell() - FOOTER
        if length > MAX_RECORD:
            raise RecordingDamaged(f"a summary of {length} bytes, the bound is {MAX_RECORD}")
        summary = self._file.read(length)
        at = 0
        while at + HEAD <= len(summary):
            opcode, length = summary[at], int.from_bytes(summary[at + 1 : at + HEAD], "little")
            content = ReadDataStream(BytesIO(summary[at + HEAD : at + HEAD + length]))
            at += HEAD + length
            if opcode == Opcode.SUMMARY_OFFSET:
                group = content.read1()
                start = content.read8()
                if group == Opcode.ATTACHMENT_INDEX:
                    found: AttachmentIndex = AttachmentIndex.read(self._record(start, group))
                    return found
        return None

    def _record(self, offset: int, opcode: int) -> ReadDataStream:
        """Return the content of one MCAP record, after its opcode and length."""
        self._seek(offset)
        head = self._file.read(HEAD)
        length = int.from_bytes(head[1:], "little")
        if len(head) < HEAD or head[0] != opcode or length > MAX_RECORD:
            raise RecordingDamaged(f"no record of kind {opcode} at {offset}")
        content = self._file.read(length)
        if len(content) < length:
            raise RecordingDamaged(f"the record at {offset} is cut off")
        return ReadDataStream(BytesIO(content))

    def _seek(self, offset: int) -> None:
        """Seek to an offset that the file names, which may be any number."""
        size = self._path.stat().st_size
        if not 0 <= offset <= size:
            raise RecordingDamaged(f"byte {offset} is beyond the end of the file, {size} bytes")
        self._file.seek(offset)
