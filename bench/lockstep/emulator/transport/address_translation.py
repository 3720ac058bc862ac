"""Translates addresses as between a machine and the Internet: one-to-one NAT in a cloud, a firewall at home. No I/O."""

import socket
import struct
from ipaddress import IPv4Address

__all__ = ["Firewall", "OneToOneNat"]

SOURCE, DESTINATION, HEADER_CHECKSUM = 12, 16, 10  # offsets in an IPv4 header (RFC 791)
CHECKSUMS = {socket.IPPROTO_TCP: 16, socket.IPPROTO_UDP: 6}  # offsets in the header behind it
ADDRESS_BYTES, PORT_BYTES = 4, 2
MOST_PATHS = 65536


class OneToOneNat:
    """Changes an inner address into an outer one and back, and no port (RFC 2663 4.1.1: basic NAT)."""

    def __init__(self, inner: str, outer: str) -> None:
        self._inner, self._outer = IPv4Address(inner).packed, IPv4Address(outer).packed

    def outward(self, packet: bytes) -> bytes | None:
        """Return an IPv4 packet from inside as it is seen outside; None if it has no outer address."""
        return _with_address(packet, SOURCE, self._inner, self._outer)

    def inward(self, packet: bytes) -> bytes | None:
        """Return an IPv4 packet from outside as it arrives; None if no host gets it, not even the inner address."""
        return _with_address(packet, DESTINATION, self._outer, self._inner)


class Firewall:
    """Lets in only answers to hosts behind it (RFC 4787 5: address and port-dependent filtering)."""

    def __init__(self) -> None:
        self._open: dict[tuple[int, bytes, bytes, bytes], None] = {}

    def leaving(self, packet: bytes) -> None:
        """Open the way for answers to an IPv4 packet."""
        protocol, source, destination, remote = packet[9], *_ports(packet), packet[DESTINATION:][:ADDRESS_BYTES]
        self._open[protocol, remote, destination, source] = None
        if len(self._open) > MOST_PATHS:
            del self._open[next(iter(self._open))]

    def admits(self, packet: bytes) -> bool:
        protocol, source, destination, remote = packet[9], *_ports(packet), packet[SOURCE:][:ADDRESS_BYTES]
        return (protocol, remote, source, destination) in self._open


def _header(packet: bytes) -> int:
    return (packet[0] & 15) * 4


def _ports(packet: bytes) -> tuple[bytes, bytes]:
    """Return source and destination port of TCP and UDP; for other protocols the bytes at that place."""
    at = _header(packet)
    return packet[at : at + PORT_BYTES], packet[at + PORT_BYTES : at + 2 * PORT_BYTES]


def _with_address(packet: bytes, at: int, old: bytes, new: bytes) -> bytes | None:
    if packet[at : at + ADDRESS_BYTES] != old:
        return None
    changed = bytearray(packet)
    changed[at : at + ADDRESS_BYTES] = new
    _update(changed, HEADER_CHECKSUM, old, new)
    checksum = CHECKSUMS.get(packet[9])
    # Only the first fragment has a header of TCP or UDP; zero says that UDP goes without a checksum.
    if checksum is not None and struct.unpack_from("!H", packet, 6)[0] & 0x1FFF == 0:
        where = _header(packet) + checksum
        if len(packet) >= where + 2 and (packet[9] != socket.IPPROTO_UDP or changed[where : where + 2] != b"\0\0"):
            _update(changed, where, old, new)
    return bytes(changed)


def _update(packet: bytearray, at: int, old: bytes, new: bytes) -> None:
    """Update the checksum at `at` after `new` replaced `old` (RFC 1624 3)."""
    total = ~struct.unpack_from("!H", packet, at)[0] & 0xFFFF
    for before, after in zip(struct.unpack("!2H", old), struct.unpack("!2H", new), strict=True):
        total += (~before & 0xFFFF) + after
    while total >> 16:
        total = (total & 0xFFFF) + (total >> 16)
    struct.pack_into("!H", packet, at, ~total & 0xFFFF)
