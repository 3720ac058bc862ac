"""STUN messages (RFC 8489) with the attributes that ICE needs (RFC 8445 16.1), and short-term credentials.

`parse` takes bytes of any sender and raises only `StunError`. It does not tell if a message is authentic: ask
`is_authentic` with the password before trusting its content.
"""

import hmac
import ipaddress
import struct
import zlib
from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum
from hashlib import sha1

from lockstep.rtc.addresses import Address

__all__ = [
    "BINDING",
    "MAX_MESSAGE",
    "Kind",
    "Message",
    "StunError",
    "StunErrorCode",
    "is_authentic",
    "pack",
    "pack_address",
    "parse",
    "parse_address",
    "parse_error_code",
    "read_attributes",
    "serialize",
    "transaction_of",
    "username_of",
]

BINDING = 0x001  # the one method that ICE uses
COOKIE = 0x2112A442
HEADER = struct.Struct("!HHI12s")
ATTRIBUTE = struct.Struct("!HH")
MAX_MESSAGE = 1280  # bytes; RFC 8489 6.1 asks senders that do not know the path's MTU to stay below this
MAX_ATTRIBUTES = 32  # of one message; an ICE check has about eight
MAX_USERNAME = 513  # bytes (RFC 8489 14.3: fewer than 509; 256 characters, a colon and 256 more by RFC 8839 5.4)
MAX_REASON = 763  # bytes (RFC 8489 14.8)

USERNAME = 0x0006
MESSAGE_INTEGRITY = 0x0008
ERROR_CODE = 0x0009
UNKNOWN_ATTRIBUTES = 0x000A
MESSAGE_INTEGRITY_SHA256 = 0x001C
XOR_MAPPED_ADDRESS = 0x0020
PRIORITY = 0x0024
USE_CANDIDATE = 0x0025
FINGERPRINT = 0x8028
ICE_CONTROLLED = 0x8029
ICE_CONTROLLING = 0x802A

# Understood in the sense of RFC 8489 14: without effect where this module only skips them.
UNDERSTOOD = frozenset({USERNAME, MESSAGE_INTEGRITY, ERROR_CODE, UNKNOWN_ATTRIBUTES, MESSAGE_INTEGRITY_SHA256})
UNDERSTOOD |= frozenset({XOR_MAPPED_ADDRESS, PRIORITY, USE_CANDIDATE, 0x0001})  # 0x0001: MAPPED-ADDRESS of RFC 3489
INTEGRITY_BYTES = 4 + 20
FINGERPRINT_BYTES = 4 + 4
FINGERPRINT_MASK = 0x5354554E  # RFC 8489 14.7


class StunError(ValueError):
    """The bytes are not a STUN message, or a value does not fit into one."""


class Kind(IntEnum):
    """The class of a message (RFC 8489 5), as its two bits stand in the first 16."""

    REQUEST = 0x000
    INDICATION = 0x010
    SUCCESS = 0x100
    ERROR = 0x110


@dataclass(frozen=True, slots=True)
class StunErrorCode:
    """ERROR-CODE (RFC 8489 14.8)."""

    code: int  # 300 to 699, 487: role conflict
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Message:
    """One message. None, False and () mean that the attribute is absent."""

    kind: Kind
    transaction: bytes  # 12 bytes
    method: int = BINDING
    username: str | None = None  # "evtj:h6vY": the receiver's name, a colon, the sender's
    priority: int | None = None  # of the peer-reflexive candidate that this check may show, 1 to 2³¹ − 1
    use_candidate: bool = False
    controlling: int | None = None  # tie-breaker, 64 bits
    controlled: int | None = None  # tie-breaker, 64 bits
    mapped: Address | None = None  # XOR-MAPPED-ADDRESS
    error: StunErrorCode | None = None
    unknown_attributes: tuple[int, ...] = ()  # UNKNOWN-ATTRIBUTES, of an error 420
    not_understood: tuple[int, ...] = ()  # comprehension-required attributes that this module does not know


def parse(data: bytes) -> Message:
    """Return the message in `data`.

    Raises:
        StunError: too long or short, not STUN, a false fingerprint, or an attribute of an impossible form.
    """
    values = read_attributes(data)
    kind_and_method, _, _, transaction = HEADER.unpack_from(data)
    username = values.get(USERNAME)
    return Message(
        kind=Kind(kind_and_method & 0x110),
        transaction=transaction,
        method=_method(kind_and_method),
        username=None if username is None else _text(username, MAX_USERNAME),
        priority=_number(values.get(PRIORITY), 4),
        use_candidate=_flag(values.get(USE_CANDIDATE)),
        controlling=_number(values.get(ICE_CONTROLLING), 8),
        controlled=_number(values.get(ICE_CONTROLLED), 8),
        mapped=parse_address(values.get(XOR_MAPPED_ADDRESS), transaction),
        error=parse_error_code(values.get(ERROR_CODE)),
        unknown_attributes=_numbers(values.get(UNKNOWN_ATTRIBUTES, b"")),
        not_understood=tuple(kind for kind in values if kind not in UNDERSTOOD and kind < 0x8000),
    )


def read_attributes(data: bytes, most: int = MAX_MESSAGE) -> dict[int, bytes]:
    """Return the attributes of a message of at most `most` bytes, by their type; of several of one type the first.

    Raises:
        StunError: too long or short, not STUN, or a false fingerprint.
    """
    values: dict[int, bytes] = {}
    for kind, start, length in _attributes(data, most):
        if MESSAGE_INTEGRITY in values and kind != FINGERPRINT:
            continue  # not covered by it (RFC 8489 14.5)
        values.setdefault(kind, data[start : start + length])  # the first one counts (RFC 8489 14)
    return values


def serialize(message: Message, password: str | None = None) -> bytes:
    """Return the message with MESSAGE-INTEGRITY if there is a password, and with FINGERPRINT always (RFC 8445 7.1).

    Raises:
        StunError: a value of the message does not fit its attribute.
    """
    key = None if password is None else password.encode()
    return pack(message.kind, message.method, message.transaction, _values(message), key)


def pack(
    kind: Kind, method: int, transaction: bytes, attributes: Iterable[tuple[int, bytes]], key: bytes | None = None
) -> bytes:
    """Return a message of any attributes; MESSAGE-INTEGRITY and FINGERPRINT are as in `serialize`.

    Raises:
        StunError: a transaction or method that fits no header, or more than MAX_MESSAGE bytes.
    """
    body = b"".join(_attribute(number, value) for number, value in attributes)
    end = len(body) + (INTEGRITY_BYTES if key is not None else 0)
    if HEADER.size + end + FINGERPRINT_BYTES > MAX_MESSAGE:
        raise StunError("message of too many bytes")
    if key is not None:
        digest = hmac.digest(key, _header(kind, method, transaction, end) + body, sha1)
        body += _attribute(MESSAGE_INTEGRITY, digest)
    data = _header(kind, method, transaction, end + FINGERPRINT_BYTES) + body
    return data + _attribute(FINGERPRINT, (zlib.crc32(data) ^ FINGERPRINT_MASK).to_bytes(4))


def is_authentic(data: bytes, password: str | bytes) -> bool:
    """True if `data`, which `parse` has accepted, has a MESSAGE-INTEGRITY of this password (RFC 8489 14.5).

    A password of bytes is the key of a long-term credential (RFC 8489 9.2.2).
    """
    secret = password.encode() if isinstance(password, str) else password
    for kind, start, length in _attributes(data):
        if kind == MESSAGE_INTEGRITY:
            covered = start - ATTRIBUTE.size
            # The length field as it was when the sender computed the digest: this attribute was the last.
            text = data[:2] + (start + 20 - HEADER.size).to_bytes(2) + data[4:covered]
            return hmac.compare_digest(hmac.digest(secret, text, sha1), data[start : start + length])
    return False


def transaction_of(data: bytes) -> tuple[Kind, bytes] | None:
    """Return the class and transaction of a datagram that may be STUN, without a further check; None if it cannot."""
    if len(data) < HEADER.size or data[0] & 0xC0 or data[4:8] != b"\x21\x12\xa4\x42":
        return None
    return Kind(int.from_bytes(data[:2]) & 0x110), bytes(data[8:20])


def username_of(data: bytes) -> str | None:
    """Return the USERNAME of a datagram that may be a request, without parsing the rest: cheap for sorting many
    datagrams. None without a USERNAME, or when malformed."""
    position, end = HEADER.size, min(len(data), MAX_MESSAGE)
    for _ in range(MAX_ATTRIBUTES):
        if position + ATTRIBUTE.size > end:
            return None
        kind, length = ATTRIBUTE.unpack_from(data, position)
        position += ATTRIBUTE.size
        if kind == USERNAME:
            value = bytes(data[position : position + length])
            return (
                value.decode("ascii") if length <= MAX_USERNAME and len(value) == length and value.isascii() else None
            )
        position += (length + 3) & ~3
    return None


def _attributes(data: bytes, most: int = MAX_MESSAGE) -> list[tuple[int, int, int]]:
    """Return the type of every attribute, the place where its value begins, and the value's length."""
    if not HEADER.size <= len(data) <= most:
        raise StunError(f"not between 20 and {most} bytes")
    kind_and_method, length, cookie, _ = HEADER.unpack_from(data)
    if kind_and_method & 0xC000 or cookie != COOKIE:
        raise StunError("not STUN")
    if length % 4 or length != len(data) - HEADER.size:
        raise StunError("another length than the header says")
    found: list[tuple[int, int, int]] = []
    position = HEADER.size
    while position < len(data):
        kind, length = ATTRIBUTE.unpack_from(data, position)  # the rest is a multiple of four bytes
        position += ATTRIBUTE.size
        if position + length > len(data):
            raise StunError("an attribute goes beyond the message")
        if len(found) == MAX_ATTRIBUTES:
            raise StunError("too many attributes")
        found.append((kind, position, length))
        if kind == FINGERPRINT:
            _check_fingerprint(data, position, length)
        position += (length + 3) & ~3
    return found


def _check_fingerprint(data: bytes, start: int, length: int) -> None:
    if length != 4 or start + 4 != len(data):
        raise StunError("a fingerprint that is not the last four bytes")  # RFC 8489 14.7
    if zlib.crc32(data[: start - ATTRIBUTE.size]) ^ FINGERPRINT_MASK != int.from_bytes(data[start:]):
        raise StunError("a false fingerprint")


def _method(kind_and_method: int) -> int:
    """Return the method: the bits of the class stand between those of the method (RFC 8489 5, figure 3)."""
    return kind_and_method & 0xF | (kind_and_method & 0xE0) >> 1 | (kind_and_method & 0x3E00) >> 2


def _header(kind: Kind, method: int, transaction: bytes, length: int) -> bytes:
    if len(transaction) != 12 or not 0 <= method < 1 << 12:
        raise StunError("a transaction has 12 bytes and a method 12 bits")
    spread = method & 0xF | (method & 0x70) << 1 | (method & 0xF80) << 2
    return HEADER.pack(spread | kind, length, COOKIE, transaction)


def _text(value: bytes, most: int) -> str:
    if len(value) > most:
        raise StunError("a text of too many bytes")
    try:
        return value.decode()
    except UnicodeDecodeError as error:
        raise StunError("a text that is not UTF-8") from error


def _number(value: bytes | None, length: int) -> int | None:
    if value is None:
        return None
    if len(value) != length:
        raise StunError(f"a number of {len(value)} bytes instead of {length}")
    return int.from_bytes(value)


def _flag(value: bytes | None) -> bool:
    if value:
        raise StunError("USE-CANDIDATE has no value")
    return value is not None


def _numbers(value: bytes) -> tuple[int, ...]:
    if len(value) % 2:
        raise StunError("half an attribute type")
    return struct.unpack(f"!{len(value) // 2}H", value)


def parse_error_code(value: bytes | None) -> StunErrorCode | None:
    """Return the value of ERROR-CODE, which may be absent. Raises StunError."""
    if value is None:
        return None
    if len(value) < 4 or not 3 <= value[2] & 7 <= 6 or value[3] > 99:
        raise StunError("an error code outside of 300 to 699")
    return StunErrorCode((value[2] & 7) * 100 + value[3], _text(value[4:], MAX_REASON))


def parse_address(value: bytes | None, transaction: bytes) -> Address | None:
    """Return the value of an attribute in the form of XOR-MAPPED-ADDRESS, which may be absent. Raises StunError."""
    if value is None:
        return None
    if (len(value), value[1:2]) not in ((8, b"\x01"), (20, b"\x02")):
        raise StunError("an address that is neither IPv4 nor IPv6")
    mask = COOKIE.to_bytes(4) + transaction
    host = bytes(a ^ b for a, b in zip(value[4:], mask, strict=False))
    return str(ipaddress.ip_address(host)), int.from_bytes(value[2:4]) ^ COOKIE >> 16


def _values(message: Message) -> list[tuple[int, bytes]]:
    values: list[tuple[int, bytes]] = []
    if message.username is not None:
        values.append((USERNAME, _bounded(message.username, MAX_USERNAME)))
    for kind, number, length in (
        (PRIORITY, message.priority, 4),
        (ICE_CONTROLLING, message.controlling, 8),
        (ICE_CONTROLLED, message.controlled, 8),
    ):
        if number is not None:
            values.append((kind, _fixed(number, length)))
    if message.use_candidate:
        values.append((USE_CANDIDATE, b""))
    if message.mapped is not None:
        values.append((XOR_MAPPED_ADDRESS, pack_address(message.mapped, message.transaction)))
    if message.error is not None:
        hundreds, rest = divmod(message.error.code, 100)
        if not 3 <= hundreds <= 6:
            raise StunError("an error code outside of 300 to 699")
        values.append((ERROR_CODE, bytes((0, 0, hundreds, rest)) + _bounded(message.error.reason, MAX_REASON)))
    if message.unknown_attributes:
        values.append((UNKNOWN_ATTRIBUTES, b"".join(_fixed(each, 2) for each in message.unknown_attributes)))
    return values


def _bounded(text: str, most: int) -> bytes:
    try:
        value = text.encode()
    except UnicodeEncodeError as error:
        raise StunError("a text that UTF-8 cannot write") from error
    if len(value) > most:
        raise StunError("a text of too many bytes")
    return value


def _fixed(number: int, length: int) -> bytes:
    try:
        return number.to_bytes(length)
    except OverflowError as error:
        raise StunError(f"{number} does not fit {length} bytes") from error


def pack_address(address: Address, transaction: bytes) -> bytes:
    """Return an address in the form of XOR-MAPPED-ADDRESS. Raises StunError."""
    try:
        host = ipaddress.ip_address(address[0]).packed
    except ValueError as error:
        raise StunError("an address that is neither IPv4 nor IPv6") from error
    mask = COOKIE.to_bytes(4) + transaction
    masked = bytes(a ^ b for a, b in zip(host, mask, strict=False))
    return bytes((0, 1 if len(host) == 4 else 2)) + _fixed(address[1] ^ COOKIE >> 16, 2) + masked


def _attribute(kind: int, value: bytes) -> bytes:
    return ATTRIBUTE.pack(kind, len(value)) + value + bytes(-len(value) % 4)
