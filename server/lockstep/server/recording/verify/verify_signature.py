"""Checks the signatures of a recording by the order of its bytes, without an index. No I/O.

Show a `SignatureChecker` every raw record of the file, then ask for its `report`.
"""

import zlib
from io import BytesIO
from typing import Literal, NamedTuple

import msgspec
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Message, Schema
from mcap.stream_reader import get_chunk_data_stream

from lockstep.server.recording.errors import RecordingError
from lockstep.server.recording.format.event_index import INDEX_NAME
from lockstep.server.recording.format.info import RecordingInfo
from lockstep.server.recording.format.payload import own_record
from lockstep.server.recording.format.records import SignatureRecord
from lockstep.server.recording.format.signature import RecordingChain, is_valid
from lockstep.server.recording.format.topics import SIGNATURE
from lockstep.server.recording.reading.raw_records import BROKEN, RawRecord, check_packed
from lockstep.server.recording.reading.scan import Scan
from lockstep.server.recording.verify.signed_topics import SignedTopics
from lockstep.server.recording.verify.verify_indexes import IndexChecker

__all__ = ["SignatureChecker", "SignatureFault", "SignatureReport"]

MOST = 50  # faults that are kept
NO_CHECKSUM = bytes(4)


class SignatureFault(NamedTuple):
    event: int  # event before the fault
    time: int  # µs since 1970
    text: str


class SignatureReport(msgspec.Struct, kw_only=True):
    """The result of the check of the signatures."""

    state: Literal["unsigned", "signed", "open", "broken"] = "unsigned"  # open: all is signed, but how it ended
    signer: str = ""  # public key
    signatures: int = 0
    until_event: int = 0  # up to here it is signed
    until_time: int = 0  # µs since 1970
    previous: str = ""  # head of the part before
    audit: str = ""  # the newest signed head of the audit that it holds
    faults: list[SignatureFault] = []


class SignatureChecker:
    """Checks the signatures of a file: `take` each raw record in the order of the file, then `report`.

    Args:
        indexes: checks the indexes of the same file
        key: public key that has to have signed it; "": any

    Attributes:
        index_faults: what an index says and the records do not, whether the file is signed or not
    """

    def __init__(self, info: RecordingInfo, indexes: IndexChecker, key: str = "") -> None:
        self._info = info
        self._indexes = indexes
        self.index_faults: list[str] = []
        self._key = key
        self._report = SignatureReport()
        self._topics = SignedTopics()
        self._chain: RecordingChain | None = None
        self._last: SignatureRecord | None = None
        self._chunks = 0
        self._metadata = 0
        self._behind_data = False
        self._summary = bytearray()

    def take(self, raw: RawRecord) -> None:
        try:
            for text in self._indexes.take(raw):
                self._index_fault(text)
            self._take(raw)
        except (*BROKEN, RecordingError) as error:
            self._fault(f"the record at byte {raw.offset} cannot be read: {error or type(error).__name__}")

    def _take(self, raw: RawRecord) -> None:
        if self._behind_data and raw.opcode != Opcode.FOOTER:
            self._summary += bytes([raw.opcode]) + len(raw.content).to_bytes(8, "little") + raw.content
        stream = ReadDataStream(BytesIO(raw.content))
        if raw.opcode == Opcode.CHUNK:
            self._chunks += 1
            self._chunk(Chunk.read(stream), self._chunks - 1)
        elif raw.opcode == Opcode.SCHEMA:
            self._topic(Schema.read(stream))
        elif raw.opcode == Opcode.CHANNEL:
            self._topic(Channel.read(stream))
        elif raw.opcode == Opcode.DATA_END:
            self._behind_data = True
            if raw.content != NO_CHECKSUM:
                self._fault("the end of the data was changed")
        elif raw.opcode == Opcode.FOOTER:
            head = raw.content[:-4]
            crc = zlib.crc32(
                bytes([raw.opcode]) + len(raw.content).to_bytes(8, "little") + head, zlib.crc32(self._summary)
            )
            if crc.to_bytes(4, "little") != raw.content[-4:]:
                self._fault("the summary was changed: its checksum does not fit")
        elif raw.opcode == Opcode.ATTACHMENT:
            self._attachment(raw.content)
        elif raw.opcode == Opcode.METADATA:
            self._metadata += 1
            if self._metadata > 1:
                self._fault("metadata is not signed")
        elif raw.opcode == Opcode.MESSAGE:
            self._fault(f"a message at byte {raw.offset} is outside of all chunks and not signed")

    def _attachment(self, content: bytes) -> None:
        if zlib.crc32(content[:-4]).to_bytes(4, "little") != content[-4:]:
            self._fault("the index was changed: its checksum does not fit")
        if INDEX_NAME.encode() not in content[:64]:
            self._fault("an attachment is not signed")

    def _topic(self, found: Schema | Channel) -> None:
        if fault := self._topics.take(found):
            self._fault(fault)

    def _chunk(self, chunk: Chunk, number: int) -> None:
        try:
            check_packed(chunk)
            stream, length = get_chunk_data_stream(chunk, validate_crc=True)
        except BROKEN as error:
            self._fault(f"chunk {number} was changed after it was written: {type(error).__name__}")
            return
        while stream.count < length:
            opcode, size = stream.read1(), stream.read8()
            if opcode == Opcode.SCHEMA:
                self._topic(Schema.read(stream))
            elif opcode == Opcode.CHANNEL:
                self._topic(Channel.read(stream))
            elif opcode == Opcode.MESSAGE:
                self._message(Message.read(stream, size))
            else:
                stream.read(size)
                self._fault(f"chunk {number} holds a record of kind {opcode} that is not signed")
        self._end_chunk(number)

    def _message(self, message: Message) -> None:
        topic = self._topics.name(message.channel_id)
        if self._chain is None:
            self._chain = RecordingChain(self._info, self._topics.sign())
        if topic == SIGNATURE:
            self._signature(self._chain, own_record(SignatureRecord, message.data), message)
            return
        self._chain.add(topic, message.sequence, message.log_time, message.publish_time, message.data)

    def _signature(self, chain: RecordingChain, found: SignatureRecord, message: Message) -> None:
        last = self._last
        self._report.signatures += 1
        if not is_valid(found):
            chain.end_chunk()
            self._fault(f"signature {found.number} is not one of {found.key or 'any key'}: it was changed or forged")
            return
        self._judge(chain.end_chunk(), found, last, message)
        chain.head = found.head  # the following records are checked against the signed head
        self._last = found
        self._report.signer = self._report.signer or found.key
        self._report.until_event, self._report.until_time = found.event, found.until // 1000
        self._report.previous, self._report.audit = found.previous, found.audit

    def _judge(self, head: str, found: SignatureRecord, last: SignatureRecord | None, message: Message) -> None:
        before = 0 if last is None else last.number
        info = self._info
        if (found.recording, found.part, found.epoch) != (info.recording, info.part, info.epoch):
            self._fault(f"signature {found.number} is of another recording")
        if found.key != (self._report.signer or found.key):
            self._fault(f"signature {found.number} is of another key than those before: {found.key}")
        if (message.log_time, message.publish_time, message.sequence) != (found.until, found.until, found.event):
            self._fault(f"signature {found.number} stands at another event or time than it says")
        if last is not None and last.final:
            self._fault(f"signature {found.number} comes after the closing one")
        if found.number > before + 1:
            self._fault(f"chunks were removed: signature {found.number} comes after signature {before}")
        elif found.number <= before:
            self._fault(f"chunks were reordered or repeated: signature {found.number} comes after signature {before}")
        elif head != found.head:
            self._fault(
                f"records after signature {before}, up to event {found.event}, are not those that were signed: "
                "changed, reordered, added or removed"
            )

    def _end_chunk(self, number: int) -> None:
        if self._chain is not None and self._chain.waiting:
            self._chain.drop_waiting()
            self._fault(f"the end of chunk {number} is not signed")

    def _index_fault(self, text: str) -> None:
        if len(self.index_faults) < MOST:
            self.index_faults.append(text)
        self._fault(text)

    def _fault(self, text: str) -> None:
        report = self._report
        if len(report.faults) < MOST:
            report.faults.append(SignatureFault(max(1, report.until_event), report.until_time, text))

    def compare(self, scan: Scan) -> None:
        """Compare the indexes with the records, behind the last one. `scan`: of the same file."""
        for text in self._indexes.compare(scan):
            self._index_fault(text)

    def report(self, *, written: bool = False) -> SignatureReport:
        """Return the report, after the last record. `written`: more will follow."""
        report, last = self._report, self._last
        if not report.signatures:
            faults = [SignatureFault(1, 0, "the recording is not signed")] if self._key else []
            return SignatureReport(faults=faults)
        if self._key and report.signer != self._key:
            self._fault(f"signed by {report.signer or 'nobody'}, not by {self._key}")
        report.state = "signed"
        if report.faults:
            report.state = "broken"
        elif last is None or not last.final:
            report.state = "open"
            why = "it is still written" if written else "the console was interrupted, or the end was cut off"
            self._fault(f"the closing signature is missing: {why}")
        return report
