"""The hash chain over a recording and the signatures of its head. No I/O; writer and `lockstep verify` share it.

The chain begins with the file's metadata and topics. Every chunk makes the next head:
SHA-256 of the head before and of the SHA-256 over the chunk's messages. The last message of each chunk is a signature.
"""

import hashlib
import json
import struct
from collections.abc import Callable, Iterable
from typing import NamedTuple

import msgspec

from lockstep.server.evidence.signer import Signer, is_signed
from lockstep.server.recording.format.info import RecordingInfo
from lockstep.server.recording.format.records import SignatureRecord

__all__ = ["RecordingChain", "RecordingSigning", "Signatures", "TopicText", "is_valid"]

CHAIN = b"lockstep recording chain 1\n"
SIGNATURE = b"lockstep recording signature 1\n"
MESSAGE = struct.Struct(">HIQQI")  # length of the topic, event, arrival, capture, length of the data


class TopicText(NamedTuple):
    """A channel of the file with its schema."""

    topic: str
    encoding: str
    schema: str
    schema_encoding: str
    schema_data: bytes


class RecordingChain:
    """The hash chain of a file: `add` each message that is no signature, `end_chunk` at the end of each chunk.

    Attributes:
        head: of the chain, 64 hexadecimal digits
        waiting: messages since the last head
    """

    def __init__(self, info: RecordingInfo, topics: Iterable[TopicText]) -> None:
        named = [[*each[:4], hashlib.sha256(each.schema_data).hexdigest()] for each in topics]
        text = json.dumps([info.metadata(), sorted(named)], sort_keys=True, separators=(",", ":"))
        self.head = hashlib.sha256(CHAIN + text.encode()).hexdigest()
        self.waiting = 0
        self._messages = hashlib.sha256()

    def add(self, topic: str, event: int, arrived: int, captured: int, data: bytes) -> None:
        name = topic.encode()
        self._messages.update(MESSAGE.pack(len(name), event, arrived, captured, len(data)) + name)
        self._messages.update(data)
        self.waiting += 1

    def end_chunk(self) -> str:
        """End a chunk and return the new head."""
        self.head = hashlib.sha256(bytes.fromhex(self.head) + self._messages.digest()).hexdigest()
        self.drop_waiting()
        return self.head

    def drop_waiting(self) -> None:
        """Drop the messages added since the last head."""
        self._messages, self.waiting = hashlib.sha256(), 0


class RecordingSigning(NamedTuple):
    """The means to sign a recording.

    Attributes:
        newest_audit: the newest signed head of the audit as JSON; "" when there is none
    """

    signer: Signer
    newest_audit: Callable[[], str]


class Signatures:
    """Signs a file that is being written: `add` every message, `sign` at the end of each chunk."""

    def __init__(
        self, signing: RecordingSigning, info: RecordingInfo, topics: Iterable[TopicText], previous: str
    ) -> None:
        self._signing = signing
        self._info = info
        self._previous = previous
        self._number = 0
        self._chain = RecordingChain(info, topics)
        self._event = 1
        self._until = 0

    @property
    def head(self) -> str:
        return self._chain.head

    def add(self, topic: str, event: int, arrived: int, captured: int, data: bytes, *, feedback: bool) -> None:
        """Add a message. `feedback`: it is a feedback; other records may name an event to come, or one long past."""
        if feedback or not self._until:
            self._event = event
        self._chain.add(topic, event, arrived, captured, data)
        self._until = arrived

    def sign(self, *, final: bool) -> SignatureRecord:
        """Return the record that ends the chunk; `final`: and the file."""
        self._number += 1
        signer, newest_audit = self._signing
        unsigned = SignatureRecord(
            epoch=self._info.epoch,
            event=self._event,
            recording=self._info.recording,
            part=self._info.part,
            number=self._number,
            until=self._until,
            final=final,
            head=self._chain.end_chunk(),
            previous=self._previous,
            audit=newest_audit(),
            key=signer.public_key,
            signature="",
        )
        return msgspec.structs.replace(unsigned, signature=signer.sign(_signed_bytes(unsigned)))


def is_valid(record: SignatureRecord) -> bool:
    """True if the owner of its key has signed it."""
    return is_signed(record.key, _signed_bytes(record), record.signature)


def _signed_bytes(record: SignatureRecord) -> bytes:
    """Return the record as JSON as in the file, with an empty signature."""
    return SIGNATURE + msgspec.json.encode(msgspec.structs.replace(record, signature=""))
