"""Frames on a pipe to a program in another Python.

A frame is the length of a JSON map (4 bytes, big-endian), the map, and the bytes that it announces: `sizes` in the map
lists their lengths. The plugins for LeRobot have the other end of it, and nothing of Lockstep.
"""

import asyncio
from collections.abc import Sequence
from typing import Any

import msgspec

__all__ = ["BadFrame", "read_request", "to_frame"]

MAX_MAP = 1 << 20

_decoder = msgspec.json.Decoder(dict[str, Any])


class BadFrame(Exception):
    """The other side of the pipe does not speak in frames."""


def to_frame(said: dict[str, Any], blocks: Sequence[bytes | memoryview] = ()) -> list[bytes | memoryview]:
    """Return the parts of a frame, to be written one after the other."""
    text = msgspec.json.encode({**said, "sizes": [len(block) for block in blocks]})
    return [len(text).to_bytes(4, "big"), text, *blocks]


async def read_request(reader: asyncio.StreamReader) -> dict[str, Any] | None:
    """Return the next request, which no bytes follow; None at the end of the pipe.

    Raises:
        BadFrame: the bytes are not a request.
    """
    try:
        size = int.from_bytes(await reader.readexactly(4), "big")
        if size > MAX_MAP:
            raise BadFrame(f"a request of {size} bytes")
        return _decoder.decode(await reader.readexactly(size))
    except asyncio.IncompleteReadError:
        return None
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise BadFrame(str(error)) from error
