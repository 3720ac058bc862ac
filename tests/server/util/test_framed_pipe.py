import asyncio
import io

import msgspec
import pytest

from lockstep.server.util.framed_pipe import FramedPipe


class Word(msgspec.Struct, frozen=True, tag="word", array_like=True):
    text: str


class Number(msgspec.Struct, frozen=True, tag="number", array_like=True):
    value: int


PIPE: FramedPipe[Word | Number] = FramedPipe(Word | Number, 100)
NONSENSE = (b"\xff\xff\xff\xff", b"\x00\x00\x00\x02\x91", b"\x00\x00\x00\x01\xc0", b"\x00", b"")


def test_messages_come_out_as_they_went_in_until_the_other_side_ends() -> None:
    file = io.BytesIO()
    PIPE.write(file, Word("one"))
    PIPE.write(file, Number(2))
    file.seek(0)
    assert [PIPE.read(file), PIPE.read(file), PIPE.read(file)] == [Word("one"), Number(2), None]


@pytest.mark.parametrize("data", [*NONSENSE, PIPE.encode(Word("x" * 100))])
async def test_what_is_not_valid_or_too_long_ends_the_pipe(data: bytes) -> None:
    assert PIPE.read(io.BytesIO(data)) is None
    reader = asyncio.StreamReader()
    reader.feed_data(data)
    reader.feed_eof()
    assert await PIPE.receive(reader) is None


async def test_a_message_is_received_however_it_is_cut() -> None:
    reader = asyncio.StreamReader()
    for byte in PIPE.encode(Word("cut")):
        reader.feed_data(bytes([byte]))
    assert await PIPE.receive(reader) == Word("cut")
