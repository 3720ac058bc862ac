"""Chunks and packets to bytes and back."""

import contextlib
import struct

import pytest
from google_crc32c import value as crc32c
from hypothesis import given
from hypothesis import strategies as st

from lockstep.rtc.sctp.errors import SctpParseError
from lockstep.rtc.sctp.wire.chunks import (
    BEGIN,
    Abort,
    Chunk,
    CookieAck,
    CookieEcho,
    Data,
    Error,
    ForwardTsn,
    Heartbeat,
    HeartbeatAck,
    Init,
    InitAck,
    InterleavedData,
    InterleavedForwardTsn,
    Reconfig,
    Sack,
    Shutdown,
    ShutdownAck,
    ShutdownComplete,
    Skip,
    Unknown,
)
from lockstep.rtc.sctp.wire.packet import decode_packet, encode_packet

U16, U32 = st.integers(0, 2**16 - 1), st.integers(0, 2**32 - 1)
BODY = st.binary(max_size=60)
PARAMETERS = st.lists(st.tuples(U16, BODY), max_size=4)
INIT = (U32, U32, U16, U16, U32, PARAMETERS)


def interleaved(tsn: int, flags: int, stream: int, sequence: int, either: int, payload: bytes) -> InterleavedData:
    fragment, protocol = (0, either) if flags & BEGIN else (either, 0)
    return InterleavedData(tsn, flags, stream, sequence, fragment, protocol, payload)


CHUNKS: st.SearchStrategy[Chunk] = st.one_of(
    st.builds(Data, U32, st.integers(0, 15), U16, U16, U32, BODY),
    st.builds(interleaved, U32, st.integers(0, 15), U16, U32, U32, BODY),
    st.builds(Init, *INIT),
    st.builds(InitAck, *INIT),
    st.builds(Sack, U32, U32, st.lists(st.tuples(U16, U16), max_size=4), st.lists(U32, max_size=4)),
    st.builds(Heartbeat, BODY),
    st.builds(HeartbeatAck, BODY),
    st.builds(Abort, PARAMETERS, st.booleans()),
    st.builds(Shutdown, U32),
    st.just(ShutdownAck()),
    st.builds(Error, PARAMETERS),
    st.builds(CookieEcho, BODY),
    st.just(CookieAck()),
    st.builds(ShutdownComplete, st.booleans()),
    st.builds(Reconfig, PARAMETERS),
    st.builds(ForwardTsn, U32, st.lists(st.builds(Skip, U16, U16), max_size=4)),
    st.builds(InterleavedForwardTsn, U32, st.lists(st.builds(Skip, U16, U32, st.booleans()), max_size=4)),
    st.builds(Unknown, st.sampled_from([12, 77, 129, 255]), st.integers(0, 255), BODY),
)


@given(U16, U16, U32, st.lists(CHUNKS, min_size=1, max_size=5))
def test_a_packet_is_read_as_it_was_written(source: int, destination: int, tag: int, chunks: list[Chunk]) -> None:
    packet = decode_packet(encode_packet(source, destination, tag, b"".join(chunk.encode() for chunk in chunks)))
    assert (packet.source, packet.destination, packet.tag) == (source, destination, tag)
    for read, written in zip(packet.chunks, chunks, strict=True):
        assert type(read) is type(written)
        assert read.encode() == written.encode()


@given(U32, st.lists(CHUNKS, min_size=1, max_size=5))
def test_chunks_end_at_a_multiple_of_four(tag: int, chunks: list[Chunk]) -> None:
    assert all(len(chunk.encode()) % 4 == 0 for chunk in chunks)


@given(st.binary(max_size=200), st.booleans())
def test_any_bytes_are_a_packet_or_a_named_error(data: bytes, with_checksum: bool) -> None:
    if with_checksum and len(data) >= 12:
        data = data[:8] + struct.pack("<L", crc32c(data[:8] + bytes(4) + data[12:])) + data[12:]
    with contextlib.suppress(SctpParseError):
        decode_packet(data)


@pytest.mark.parametrize(
    ("chunks", "message"),
    [
        (b"", "shorter"),
        (b"\x00\x03\x00", "shorter"),
        (b"\x00\x03\x00\x03", "wrong length"),
        (b"\x00\x03\x00\x20" + bytes(8), "wrong length"),
        (b"\x00\x03\x00\x10" + bytes(12) + b"\x00\x00", "cut short"),
        (b"\x03\x00\x00\x0c" + bytes(8), "too short"),
        (Sack(1, 2).encode()[:-4] + b"\x00\x01\x00\x00", "shorter than its counts"),
        (b"\x01\x00\x00\x16" + bytes(18) + bytes(2), "cut short"),
        (b"\x01\x00\x00\x18" + bytes(16) + b"\x00\x01\x00\x02", "wrong length"),
        (b"\xc0\x00\x00\x0a" + bytes(8), "wrong length"),
        (b"\xc2\x00\x00\x0c" + bytes(8), "wrong length"),
    ],
)
def test_inconsistent_lengths_are_refused(chunks: bytes, message: str) -> None:
    with pytest.raises(SctpParseError, match=message):
        decode_packet(encode_packet(5000, 5000, 1, chunks))


def test_a_wrong_checksum_is_refused() -> None:
    packet = bytearray(encode_packet(5000, 5000, 1, ShutdownAck().encode()))
    packet[4] ^= 1
    with pytest.raises(SctpParseError, match="checksum"):
        decode_packet(bytes(packet))


def test_the_checksum_is_that_of_rfc_9260_with_the_bytes_swapped() -> None:
    packet = encode_packet(5000, 5000, 0x12345678, CookieAck().encode())
    assert packet[:8] == bytes.fromhex("1388138812345678")
    assert packet[8:12] == crc32c(packet[:8] + bytes(4) + packet[12:]).to_bytes(4, "little")
    assert packet[12:] == bytes.fromhex("0b000004")
