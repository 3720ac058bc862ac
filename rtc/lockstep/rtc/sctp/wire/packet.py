"""An SCTP packet: the common header and its chunks (RFC 9260 3)."""

from dataclasses import dataclass
from struct import Struct

from google_crc32c import value as crc32c

from lockstep.rtc.sctp.errors import SctpParseError
from lockstep.rtc.sctp.wire.chunks import CHUNK_HEADER, DECODERS, Chunk, Unknown

__all__ = ["COMMON_HEADER", "Packet", "decode_packet", "encode_packet"]

COMMON_HEADER = 12

_ports_and_tag = Struct("!HHL")
_checksum = Struct("<L")  # RFC 9260 appendix A: the checksum's bytes are swapped
_chunk = Struct("!BBH")
_NO_CHECKSUM = bytes(4)


@dataclass(slots=True)
class Packet:
    """A received packet."""

    source: int  # port
    destination: int
    tag: int
    chunks: list[Chunk]


def encode_packet(source: int, destination: int, tag: int, chunks: bytes) -> bytes:
    """Return a packet of encoded chunks."""
    header = _ports_and_tag.pack(source, destination, tag)
    return header + _checksum.pack(crc32c(header + _NO_CHECKSUM + chunks)) + chunks


def decode_packet(data: bytes) -> Packet:
    """Return a packet with all its chunks, unknown types as they are.

    Raises:
        SctpParseError: too short, wrong checksum, or a chunk that is not what its type and length say. No chunk of
            such a packet is used.
    """
    size = len(data)
    if size < COMMON_HEADER + CHUNK_HEADER:
        raise SctpParseError("shorter than a packet with one chunk")
    source, destination, tag = _ports_and_tag.unpack_from(data)
    if _checksum.unpack_from(data, 8)[0] != crc32c(data[:8] + _NO_CHECKSUM + data[12:]):
        raise SctpParseError("wrong checksum")
    chunks: list[Chunk] = []
    start = COMMON_HEADER
    while start < size:
        if size - start < CHUNK_HEADER:
            raise SctpParseError("a chunk header is cut short")
        kind, flags, length = _chunk.unpack_from(data, start)
        end = start + length
        if length < CHUNK_HEADER or end > size:
            raise SctpParseError("a chunk has the wrong length")
        known = DECODERS.get(kind)
        if known is None:
            chunks.append(Unknown(kind, flags, data[start + CHUNK_HEADER : end]))
        elif length - CHUNK_HEADER < known[0]:
            raise SctpParseError("a chunk is too short")
        else:
            chunks.append(known[1](flags, data, start + CHUNK_HEADER, end))
        start = end + -length % 4
    return Packet(source, destination, tag, chunks)
