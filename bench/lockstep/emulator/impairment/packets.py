"""Classifies datagrams by their first byte (RFC 7983), and reads the names in a STUN check (RFC 8489). No I/O."""

import struct
from typing import Literal

__all__ = ["Kind", "kind_of", "stun_username"]

Kind = Literal["stun", "control", "media"]

HEADER = 20  # bytes
MAGIC = b"\x21\x12\xa4\x42"
BINDING_REQUEST = 0x0001
USERNAME = 0x0006


def kind_of(data: bytes | memoryview) -> Kind:
    """Return the kind of a datagram. DTLS, and everything that is neither STUN nor media, is control."""
    first = data[0] if data else 255
    if 128 <= first <= 191:
        return "media"
    return "stun" if first <= 3 else "control"


def stun_username(data: bytes) -> str | None:
    """Return the USERNAME of a binding request, "theirs:ours"; None for another packet."""
    if len(data) < HEADER or data[4:8] != MAGIC or struct.unpack_from("!H", data)[0] != BINDING_REQUEST:
        return None
    position = HEADER
    while position + 4 <= len(data):
        kind, length = struct.unpack_from("!HH", data, position)
        if kind == USERNAME:
            return data[position + 4 : position + 4 + length].decode("utf-8", "replace")
        position += 4 + (length + 3) // 4 * 4  # padded to 4 bytes (RFC 8489 14)
    return None
