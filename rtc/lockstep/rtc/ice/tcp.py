"""Datagrams on a TCP connection (RFC 6544 3, RFC 4571 2): two bytes of length before each."""

from collections import Counter

__all__ = ["MAX_DATAGRAM", "FramingError", "TcpFraming", "frame"]

MAX_DATAGRAM = 0xFFFF  # bytes; the length field has 16 bits


class FramingError(ValueError):
    """The datagram has more bytes than a length field can say."""


def frame(data: bytes) -> bytes:
    """Return the frame of a datagram.

    Raises:
        FramingError: more than `MAX_DATAGRAM` bytes.
    """
    if len(data) > MAX_DATAGRAM:
        raise FramingError(f"{len(data)} bytes do not fit one frame")
    return len(data).to_bytes(2) + data


class TcpFraming:
    """Finds datagrams in the bytes of one connection, which come in pieces of any size.

    A peer may not announce more than `max_datagram` bytes, because the beginning is kept until the end is there. After
    `too_long` close the connection; the frames that follow cannot be told apart.
    """

    def __init__(self, max_datagram: int = 2048) -> None:
        """`max_datagram`: in bytes. An Ethernet path has at most 1,500, and peers send the same over TCP and UDP."""
        self._max = max_datagram
        self._kept = bytearray()
        self.too_long = False
        self.counts: Counter[str] = Counter()

    def receive_bytes(self, data: bytes) -> list[bytes]:
        if self.too_long:
            return []
        self._kept += data
        datagrams: list[bytes] = []
        position = 0
        while len(self._kept) - position >= 2:
            length = int.from_bytes(self._kept[position : position + 2])
            if length > self._max:
                self.too_long = True
                self.counts["frame_too_long"] += 1
                self._kept.clear()
                return datagrams
            if len(self._kept) - position - 2 < length:
                break
            position += 2 + length
            if length:
                datagrams.append(bytes(self._kept[position - length : position]))
            else:
                self.counts["empty_frame"] += 1  # RFC 4571 2: permitted, and without effect
        del self._kept[:position]
        return datagrams
