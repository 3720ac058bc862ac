"""The messages of a TURN client (RFC 8656 5, 18): attributes, ChannelData, and the borders of both on a stream."""

import struct
from enum import IntEnum
from hashlib import md5

from lockstep.rtc.stun import COOKIE

__all__ = [
    "CHANNELS",
    "MAX_TURN_MESSAGE",
    "Attribute",
    "Method",
    "TurnStream",
    "long_term_key",
    "pack_channel_data",
    "parse_channel_data",
]

CHANNELS = range(0x4000, 0x5000)  # RFC 8656 12
CHANNEL_HEADER = struct.Struct("!HH")
STUN_HEADER = 20
MAX_TURN_MESSAGE = 2048  # bytes: a datagram as large as the socket takes, with what TURN puts around it


class Method(IntEnum):
    """The methods of RFC 8656 17."""

    ALLOCATE = 0x003
    REFRESH = 0x004
    DATA = 0x007
    CHANNEL_BIND = 0x009


class Attribute(IntEnum):
    """The attributes of RFC 8489 14 and RFC 8656 18."""

    USERNAME = 0x0006
    MESSAGE_INTEGRITY = 0x0008
    ERROR_CODE = 0x0009
    CHANNEL_NUMBER = 0x000C
    LIFETIME = 0x000D
    XOR_PEER_ADDRESS = 0x0012
    DATA = 0x0013
    REALM = 0x0014
    NONCE = 0x0015
    XOR_RELAYED_ADDRESS = 0x0016
    REQUESTED_TRANSPORT = 0x0019
    XOR_MAPPED_ADDRESS = 0x0020


def long_term_key(username: str, realm: bytes, password: str) -> bytes:
    """Return the key of RFC 8489 9.2.2. Every TURN server has this one; the stronger one is not deployed."""
    return md5(username.encode() + b":" + realm + b":" + password.encode(), usedforsecurity=False).digest()


def pack_channel_data(channel: int, data: bytes, *, padded: bool) -> bytes:
    """Return ChannelData. `padded`: on a stream, to a multiple of four bytes (RFC 8656 12.5)."""
    return CHANNEL_HEADER.pack(channel, len(data)) + data + (bytes(-len(data) % 4) if padded else b"")


def parse_channel_data(message: bytes) -> tuple[int, bytes] | None:
    """Return channel and data; None for another message."""
    if len(message) < CHANNEL_HEADER.size:
        return None
    channel, length = CHANNEL_HEADER.unpack_from(message)
    if channel not in CHANNELS or len(message) < CHANNEL_HEADER.size + length:
        return None
    return channel, message[CHANNEL_HEADER.size : CHANNEL_HEADER.size + length]


class TurnStream:
    """Finds messages in the bytes of a TCP connection. `broken`: the bytes are not TURN; close it."""

    def __init__(self) -> None:
        self.broken = False
        self._kept = bytearray()

    def receive_bytes(self, data: bytes) -> list[bytes]:
        if self.broken:
            return []
        self._kept += data
        messages: list[bytes] = []
        while (length := self._length()) is not None and len(self._kept) >= length:
            messages.append(bytes(self._kept[:length]))
            del self._kept[:length]
        return messages

    def _length(self) -> int | None:
        """Return the length of the message at the beginning; None: not known yet, or not a message."""
        if len(self._kept) < 8:  # no message is shorter but ChannelData of at most four bytes, which no server sends
            return None
        first, length = int.from_bytes(self._kept[:2]), int.from_bytes(self._kept[2:4])
        if first in CHANNELS:
            whole = CHANNEL_HEADER.size + (length + 3 & ~3)
        else:
            whole = STUN_HEADER + length
            self.broken = bool(first & 0xC000) or int.from_bytes(self._kept[4:8]) != COOKIE or bool(length % 4)
        self.broken = self.broken or whole > MAX_TURN_MESSAGE
        if self.broken:
            self._kept.clear()
            return None
        return whole
