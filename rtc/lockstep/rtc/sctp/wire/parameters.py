"""Type-length-value lists: the parameters of INIT and RE-CONFIG, and the causes of ABORT and ERROR (RFC 9260 3.2.1)."""

from collections.abc import Sequence
from struct import Struct

from lockstep.rtc.sctp.errors import SctpParseError

__all__ = [
    "ADD_INCOMING_STREAMS",
    "ADD_OUTGOING_STREAMS",
    "FORWARD_TSN_SUPPORTED",
    "INCOMING_RESET_REQUEST",
    "INVALID_STREAM",
    "OUTGOING_RESET_REQUEST",
    "PROTOCOL_VIOLATION",
    "RECONFIG_RESPONSE",
    "STALE_COOKIE",
    "STATE_COOKIE",
    "SUPPORTED_EXTENSIONS",
    "TSN_RESET_REQUEST",
    "UNRECOGNIZED_CHUNK",
    "UNRECOGNIZED_PARAMETER",
    "USER_ABORT",
    "Parameter",
    "decode_parameters",
    "encode_parameters",
]

Parameter = tuple[int, bytes]  # type and value

# RFC 9260 3.3.2 and 3.3.3, RFC 3758 3.1, RFC 5061 4.2.7
STATE_COOKIE = 7
UNRECOGNIZED_PARAMETER = 8
SUPPORTED_EXTENSIONS = 0x8008
FORWARD_TSN_SUPPORTED = 0xC000

# RFC 6525 4
OUTGOING_RESET_REQUEST = 13
INCOMING_RESET_REQUEST = 14
TSN_RESET_REQUEST = 15
RECONFIG_RESPONSE = 16
ADD_OUTGOING_STREAMS = 17
ADD_INCOMING_STREAMS = 18

# Causes, RFC 9260 3.3.10
INVALID_STREAM = 1
STALE_COOKIE = 3
UNRECOGNIZED_CHUNK = 6
USER_ABORT = 12
PROTOCOL_VIOLATION = 13

_header = Struct("!HH")


def decode_parameters(data: bytes, start: int = 0) -> list[Parameter]:
    """Return the parameters from `start` to the end.

    Raises:
        SctpParseError: a length is less than four or points beyond the end.
    """
    found, end = [], len(data)
    while start < end:
        if end - start < 4:
            raise SctpParseError("a parameter is cut short")
        kind, length = _header.unpack_from(data, start)
        if length < 4 or start + length > end:
            raise SctpParseError("a parameter has the wrong length")
        found.append((kind, data[start + 4 : start + length]))
        start += length + -length % 4  # the last one's padding may be missing
    return found


def encode_parameters(parameters: Sequence[Parameter]) -> bytes:
    """Return all parameters, each padded to a multiple of four; the chunk's length counts the last padding too."""
    return b"".join(_header.pack(kind, len(value) + 4) + value + bytes(-len(value) % 4) for kind, value in parameters)
