"""The chunks of SCTP as WebRTC uses it, to and from bytes (RFC 9260 3.3, 3758 3.2, 6525 3.1, 8260 2)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from struct import Struct
from typing import ClassVar

from lockstep.rtc.sctp.errors import SctpParseError
from lockstep.rtc.sctp.wire.parameters import Parameter, decode_parameters, encode_parameters

__all__ = [
    "BEGIN",
    "CHUNK_HEADER",
    "DECODERS",
    "DATA_HEADER",
    "END",
    "IMMEDIATE",
    "INTERLEAVED_HEADER",
    "UNORDERED",
    "Abort",
    "Chunk",
    "CookieAck",
    "CookieEcho",
    "Data",
    "Error",
    "ForwardTsn",
    "Heartbeat",
    "HeartbeatAck",
    "Init",
    "InitAck",
    "InterleavedData",
    "InterleavedForwardTsn",
    "Reconfig",
    "Sack",
    "Shutdown",
    "ShutdownAck",
    "ShutdownComplete",
    "Skip",
    "Unknown",
    "encode_data",
    "encode_interleaved",
    "encode_plain_sack",
]

# Flags of DATA and I-DATA, RFC 9260 3.3.1
END = 1
BEGIN = 2
UNORDERED = 4
IMMEDIATE = 8  # RFC 7053: acknowledge at once

CHUNK_HEADER = 4
DATA_HEADER = 16
INTERLEAVED_HEADER = 20

_chunk = Struct("!BBH")
_data = Struct("!BBHLHHL")
_interleaved = Struct("!BBHLHHLL")
_init = Struct("!LLHHL")
_sack = Struct("!LLHH")
_plain_sack = Struct("!BBHLLHH")
_gap = Struct("!HH")
_word = Struct("!L")
_interleaved_skip = Struct("!HHL")


def _packed(kind: int, flags: int, body: bytes) -> bytes:
    """Return a chunk padded to a multiple of four, which the length does not count."""
    return _chunk.pack(kind, flags, CHUNK_HEADER + len(body)) + body + bytes(-len(body) % 4)


def encode_data(tsn: int, flags: int, stream: int, sequence: int, protocol: int, payload: bytes) -> bytes:
    """Return a DATA chunk."""
    length = DATA_HEADER + len(payload)
    encoded = _data.pack(0, flags, length, tsn, stream, sequence, protocol) + payload
    return encoded + bytes(-length % 4) if length % 4 else encoded


def encode_interleaved(tsn: int, flags: int, stream: int, sequence: int, either: int, payload: bytes) -> bytes:
    """Return an I-DATA chunk. `either`: the PPID of a first fragment, the number of another one."""
    length = INTERLEAVED_HEADER + len(payload)
    encoded = _interleaved.pack(64, flags, length, tsn, stream, 0, sequence, either) + payload
    return encoded + bytes(-length % 4) if length % 4 else encoded


def encode_plain_sack(cumulative: int, window: int) -> bytes:
    """Return a SACK without gaps and duplicates."""
    return _plain_sack.pack(3, 0, CHUNK_HEADER + _sack.size, cumulative, window, 0, 0)


@dataclass(slots=True)
class Data:
    """DATA (RFC 9260 3.3.1): a message, or a fragment of one, whose fragments have consecutive TSNs."""

    kind: ClassVar[int] = 0
    tsn: int
    flags: int
    stream: int
    sequence: int  # of the ordered message on its stream, 16 bits
    protocol: int  # PPID
    payload: bytes

    def encode(self) -> bytes:
        return encode_data(self.tsn, self.flags, self.stream, self.sequence, self.protocol, self.payload)

    @classmethod
    def decode(cls, flags: int, data: bytes, start: int, end: int) -> "Data":
        _, _, _, tsn, stream, sequence, protocol = _data.unpack_from(data, start - CHUNK_HEADER)
        return cls(tsn, flags, stream, sequence, protocol, data[start + 12 : end])


@dataclass(slots=True)
class InterleavedData:
    """I-DATA (RFC 8260 2.1): fragments have a number within their message, so that messages may take turns."""

    kind: ClassVar[int] = 64
    tsn: int
    flags: int
    stream: int
    sequence: int  # message identifier, 32 bits, ordered and unordered messages apart
    fragment: int  # FSN; 0 of the first, which has the PPID in its place
    protocol: int  # PPID, known of the first fragment; 0 of the others
    payload: bytes

    def encode(self) -> bytes:
        either = self.protocol if self.flags & BEGIN else self.fragment
        return encode_interleaved(self.tsn, self.flags, self.stream, self.sequence, either, self.payload)

    @classmethod
    def decode(cls, flags: int, data: bytes, start: int, end: int) -> "InterleavedData":
        _, _, _, tsn, stream, _, sequence, either = _interleaved.unpack_from(data, start - CHUNK_HEADER)
        fragment, protocol = (0, either) if flags & BEGIN else (either, 0)
        return cls(tsn, flags, stream, sequence, fragment, protocol, data[start + 16 : end])


@dataclass(slots=True)
class Init:
    """INIT (RFC 9260 3.3.2)."""

    kind: ClassVar[int] = 1
    initiate_tag: int
    window: int
    outbound_streams: int
    inbound_streams: int
    initial_tsn: int
    parameters: list[Parameter] = field(default_factory=list)

    def encode(self) -> bytes:
        fixed = _init.pack(
            self.initiate_tag, self.window, self.outbound_streams, self.inbound_streams, self.initial_tsn
        )
        return _packed(self.kind, 0, fixed + encode_parameters(self.parameters))

    @classmethod
    def decode(cls, flags: int, data: bytes, start: int, end: int) -> "Init":
        tag, window, outbound, inbound, initial_tsn = _init.unpack_from(data, start)
        return cls(tag, window, outbound, inbound, initial_tsn, decode_parameters(data[start:end], _init.size))


@dataclass(slots=True)
class InitAck(Init):
    """INIT ACK (RFC 9260 3.3.3)."""

    kind: ClassVar[int] = 2


@dataclass(slots=True)
class Sack:
    """SACK (RFC 9260 3.3.4). `gaps` are first and last offsets from `cumulative` of the chunks beyond it."""

    kind: ClassVar[int] = 3
    cumulative: int
    window: int
    gaps: Sequence[tuple[int, int]] = ()
    duplicates: Sequence[int] = ()

    def encode(self) -> bytes:
        if not self.gaps and not self.duplicates:
            return encode_plain_sack(self.cumulative, self.window)
        body = _sack.pack(self.cumulative, self.window, len(self.gaps), len(self.duplicates))
        body += b"".join(_gap.pack(*gap) for gap in self.gaps)
        body += b"".join(_word.pack(tsn) for tsn in self.duplicates)
        return _packed(self.kind, 0, body)

    @classmethod
    def decode(cls, flags: int, data: bytes, start: int, end: int) -> "Sack":
        cumulative, window, gaps, duplicates = _sack.unpack_from(data, start)
        middle = start + _sack.size + 4 * gaps
        if middle + 4 * duplicates > end:
            raise SctpParseError("a SACK is shorter than its counts")
        return cls(
            cumulative,
            window,
            [_gap.unpack_from(data, at) for at in range(start + _sack.size, middle, 4)] if gaps else (),
            [_word.unpack_from(data, at)[0] for at in range(middle, middle + 4 * duplicates, 4)] if duplicates else (),
        )


@dataclass(slots=True)
class _Opaque:
    """A chunk whose value is bytes."""

    kind: ClassVar[int]
    body: bytes = b""

    def encode(self) -> bytes:
        return _packed(self.kind, 0, self.body)


@dataclass(slots=True)
class Heartbeat(_Opaque):
    """HEARTBEAT (RFC 9260 3.3.5), with its parameter as it is: only its sender reads it."""

    kind: ClassVar[int] = 4

    @classmethod
    def decode(cls, flags: int, data: bytes, start: int, end: int) -> "Heartbeat":
        return cls(data[start:end])


@dataclass(slots=True)
class HeartbeatAck(_Opaque):
    """HEARTBEAT ACK (RFC 9260 3.3.6)."""

    kind: ClassVar[int] = 5

    @classmethod
    def decode(cls, flags: int, data: bytes, start: int, end: int) -> "HeartbeatAck":
        return cls(data[start:end])


@dataclass(slots=True)
class Abort:
    """ABORT (RFC 9260 3.3.7). `reflected`: the tag is the receiver's own (T bit)."""

    kind: ClassVar[int] = 6
    causes: list[Parameter] = field(default_factory=list)
    reflected: bool = False

    def encode(self) -> bytes:
        return _packed(6, int(self.reflected), encode_parameters(self.causes))

    @classmethod
    def decode(cls, flags: int, data: bytes, start: int, end: int) -> "Abort":
        return cls(decode_parameters(data[start:end]), bool(flags & 1))


@dataclass(slots=True)
class Shutdown:
    """SHUTDOWN (RFC 9260 3.3.8)."""

    kind: ClassVar[int] = 7
    cumulative: int

    def encode(self) -> bytes:
        return _packed(7, 0, _word.pack(self.cumulative))

    @classmethod
    def decode(cls, flags: int, data: bytes, start: int, end: int) -> "Shutdown":
        return cls(_word.unpack_from(data, start)[0])


@dataclass(slots=True)
class ShutdownAck:
    """SHUTDOWN ACK (RFC 9260 3.3.9)."""

    kind: ClassVar[int] = 8

    def encode(self) -> bytes:
        return _packed(8, 0, b"")

    @classmethod
    def decode(cls, flags: int, data: bytes, start: int, end: int) -> "ShutdownAck":
        return cls()


@dataclass(slots=True)
class Error:
    """ERROR (RFC 9260 3.3.10)."""

    kind: ClassVar[int] = 9
    causes: list[Parameter] = field(default_factory=list)

    def encode(self) -> bytes:
        return _packed(9, 0, encode_parameters(self.causes))

    @classmethod
    def decode(cls, flags: int, data: bytes, start: int, end: int) -> "Error":
        return cls(decode_parameters(data[start:end]))


@dataclass(slots=True)
class CookieEcho(_Opaque):
    """COOKIE ECHO (RFC 9260 3.3.11)."""

    kind: ClassVar[int] = 10

    @classmethod
    def decode(cls, flags: int, data: bytes, start: int, end: int) -> "CookieEcho":
        return cls(data[start:end])


@dataclass(slots=True)
class CookieAck:
    """COOKIE ACK (RFC 9260 3.3.12)."""

    kind: ClassVar[int] = 11

    def encode(self) -> bytes:
        return _packed(11, 0, b"")

    @classmethod
    def decode(cls, flags: int, data: bytes, start: int, end: int) -> "CookieAck":
        return cls()


@dataclass(slots=True)
class ShutdownComplete:
    """SHUTDOWN COMPLETE (RFC 9260 3.3.13). `reflected`: the tag is the receiver's own (T bit)."""

    kind: ClassVar[int] = 14
    reflected: bool = False

    def encode(self) -> bytes:
        return _packed(14, int(self.reflected), b"")

    @classmethod
    def decode(cls, flags: int, data: bytes, start: int, end: int) -> "ShutdownComplete":
        return cls(bool(flags & 1))


@dataclass(slots=True)
class Reconfig:
    """RE-CONFIG (RFC 6525 3.1)."""

    kind: ClassVar[int] = 130
    parameters: list[Parameter] = field(default_factory=list)

    def encode(self) -> bytes:
        return _packed(130, 0, encode_parameters(self.parameters))

    @classmethod
    def decode(cls, flags: int, data: bytes, start: int, end: int) -> "Reconfig":
        return cls(decode_parameters(data[start:end]))


@dataclass(slots=True)
class Skip:
    """A stream on which messages were given up: up to `sequence`, of the unordered or the ordered ones."""

    stream: int
    sequence: int
    unordered: bool = False


@dataclass(slots=True)
class ForwardTsn:
    """FORWARD TSN (RFC 3758 3.2): nothing up to `cumulative` comes any more."""

    kind: ClassVar[int] = 192
    cumulative: int
    skips: list[Skip] = field(default_factory=list)

    def encode(self) -> bytes:
        skips = b"".join(_gap.pack(skip.stream, skip.sequence) for skip in self.skips)
        return _packed(192, 0, _word.pack(self.cumulative) + skips)

    @classmethod
    def decode(cls, flags: int, data: bytes, start: int, end: int) -> "ForwardTsn":
        if (end - start) % 4:
            raise SctpParseError("a FORWARD TSN has the wrong length")
        skips = [Skip(*_gap.unpack_from(data, at)) for at in range(start + 4, end, 4)]
        return cls(_word.unpack_from(data, start)[0], skips)


@dataclass(slots=True)
class InterleavedForwardTsn:
    """I-FORWARD-TSN (RFC 8260 2.3.1)."""

    kind: ClassVar[int] = 194
    cumulative: int
    skips: list[Skip] = field(default_factory=list)

    def encode(self) -> bytes:
        skips = b"".join(_interleaved_skip.pack(skip.stream, int(skip.unordered), skip.sequence) for skip in self.skips)
        return _packed(194, 0, _word.pack(self.cumulative) + skips)

    @classmethod
    def decode(cls, flags: int, data: bytes, start: int, end: int) -> "InterleavedForwardTsn":
        if (end - start) % 8 != 4:
            raise SctpParseError("an I-FORWARD-TSN has the wrong length")
        found = (_interleaved_skip.unpack_from(data, at) for at in range(start + 4, end, 8))
        skips = [Skip(stream, sequence, bool(more & 1)) for stream, more, sequence in found]
        return cls(_word.unpack_from(data, start)[0], skips)


@dataclass(slots=True)
class Unknown:
    """A chunk of an unknown type. The two highest bits of the type say what to do (RFC 9260 3.2)."""

    kind: int
    flags: int
    body: bytes

    def encode(self) -> bytes:
        return _packed(self.kind, self.flags, self.body)


Chunk = (
    Data
    | InterleavedData
    | Init
    | InitAck
    | Sack
    | Heartbeat
    | HeartbeatAck
    | Abort
    | Shutdown
    | ShutdownAck
    | Error
    | CookieEcho
    | CookieAck
    | ShutdownComplete
    | Reconfig
    | ForwardTsn
    | InterleavedForwardTsn
    | Unknown
)

# The shortest value that each type can have, and the decoder of `data[start:end]` behind a header of four bytes.
# Decoders raise SctpParseError for inconsistent values.
DECODERS: dict[int, tuple[int, Callable[[int, bytes, int, int], Chunk]]] = {
    Data.kind: (12, Data.decode),
    Init.kind: (16, Init.decode),
    InitAck.kind: (16, InitAck.decode),
    Sack.kind: (12, Sack.decode),
    Heartbeat.kind: (0, Heartbeat.decode),
    HeartbeatAck.kind: (0, HeartbeatAck.decode),
    Abort.kind: (0, Abort.decode),
    Shutdown.kind: (4, Shutdown.decode),
    ShutdownAck.kind: (0, ShutdownAck.decode),
    Error.kind: (0, Error.decode),
    CookieEcho.kind: (0, CookieEcho.decode),
    CookieAck.kind: (0, CookieAck.decode),
    ShutdownComplete.kind: (0, ShutdownComplete.decode),
    InterleavedData.kind: (16, InterleavedData.decode),
    Reconfig.kind: (0, Reconfig.decode),
    ForwardTsn.kind: (4, ForwardTsn.decode),
    InterleavedForwardTsn.kind: (4, InterleavedForwardTsn.decode),
}
