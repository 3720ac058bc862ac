"""Messages of the Data Channel Establishment Protocol (RFC 8832)."""

from dataclasses import dataclass
from struct import Struct

__all__ = ["ACK", "DcepError", "Open", "Reliability", "decode_open"]

ACK = b"\x02"
OPEN = 3
MOST_TEXT = 1024  # bytes of a label, and of a protocol; the format has room for 65,535

UNORDERED = 0x80
RELIABLE, RETRANSMITS, LIFETIME = 0, 1, 2

_open = Struct("!BBHLHH")


class DcepError(ValueError):
    """The message is not a valid DATA_CHANNEL_OPEN. The only error that the parser raises."""


@dataclass(frozen=True, slots=True)
class Reliability:
    """The reliability of a channel: at most one of the limits; None, None: a message is repeated until it arrives."""

    ordered: bool = True
    max_retransmits: int | None = None
    lifetime: float | None = None  # s, for which a message is worth sending

    def __post_init__(self) -> None:
        if self.max_retransmits is not None and self.lifetime is not None:
            raise ValueError("a channel has a limit of repeats or of time, not both")
        if self.max_retransmits is not None and not 0 <= self.max_retransmits <= 65535:
            raise ValueError("max_retransmits is 0 to 65535")
        if self.lifetime is not None and not 0 <= self.lifetime <= 65.535:
            raise ValueError("lifetime is 0 to 65.535 s")


@dataclass(frozen=True, slots=True)
class Open:
    """DATA_CHANNEL_OPEN (RFC 8832 5.1). The priority is neither sent nor used."""

    label: str = ""
    protocol: str = ""
    reliability: Reliability = Reliability()

    def encode(self) -> bytes:
        """Return the message.

        Raises:
            ValueError: the label or the protocol is longer than 1,024 bytes.
        """
        label, protocol = self.label.encode(), self.protocol.encode()
        if max(len(label), len(protocol)) > MOST_TEXT:
            raise ValueError(f"a label or protocol has at most {MOST_TEXT} bytes")
        limits = self.reliability
        kind, limit = RELIABLE, 0
        if limits.max_retransmits is not None:
            kind, limit = RETRANSMITS, limits.max_retransmits
        elif limits.lifetime is not None:
            kind, limit = LIFETIME, round(limits.lifetime * 1000)
        kind |= 0 if limits.ordered else UNORDERED
        return _open.pack(OPEN, kind, 0, limit, len(label), len(protocol)) + label + protocol


def decode_open(data: bytes) -> Open:
    """Return the content of a DATA_CHANNEL_OPEN.

    Raises:
        DcepError: too short, an unknown type, text that is not UTF-8 or too long.
    """
    if len(data) < _open.size:
        raise DcepError("too short")
    kind, channel_type, _, limit, label_size, protocol_size = _open.unpack_from(data)
    if kind != OPEN or channel_type & ~UNORDERED > LIFETIME:
        raise DcepError("an unknown type")
    if max(label_size, protocol_size) > MOST_TEXT or len(data) != _open.size + label_size + protocol_size:
        raise DcepError("text of the wrong length")
    middle = _open.size + label_size
    try:
        label, protocol = data[_open.size : middle].decode(), data[middle:].decode()
    except UnicodeDecodeError as error:
        raise DcepError("text that is no UTF-8") from error
    limit = min(limit, 65535)
    return Open(
        label,
        protocol,
        Reliability(
            ordered=not channel_type & UNORDERED,
            max_retransmits=limit if channel_type & ~UNORDERED == RETRANSMITS else None,
            lifetime=limit / 1000 if channel_type & ~UNORDERED == LIFETIME else None,
        ),
    )
