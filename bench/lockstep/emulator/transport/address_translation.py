"""Translates addresses as between a machine and the Internet: one-to-one NAT in a cloud, a router at home. No I/O."""

import socket
import struct
from ipaddress import IPv4Address

__all__ = ["Firewall", "OneToOneNat", "PortNat"]

SOURCE, DESTINATION, HEADER_CHECKSUM = 12, 16, 10  # offsets in an IPv4 header (RFC 791)
CHECKSUMS = {socket.IPPROTO_TCP: 16, socket.IPPROTO_UDP: 6}  # offsets in the header behind it
ADDRESS_BYTES, PORT_BYTES = 4, 2
MOST_PATHS = 65536
FIRST_PORT, PORTS = 20000, 40000  # that a router of many hosts gives out

_Path = tuple[int, bytes, bytes, bytes]  # protocol, own port, the remote's address and port


class OneToOneNat:
    """Changes an inner address into an outer one and back, and no port (RFC 2663 4.1.1: basic NAT)."""

    def __init__(self, inner: str, outer: str) -> None:
        self._inner, self._outer = IPv4Address(inner).packed, IPv4Address(outer).packed

    def outward(self, packet: bytes) -> bytes | None:
        """Return an IPv4 packet from inside as it is seen outside; None if it has no outer address."""
        return _changed(packet, SOURCE, self._inner, self._outer)

    def inward(self, packet: bytes) -> bytes | None:
        """Return an IPv4 packet from outside as it arrives; None if no host gets it, not even the inner address."""
        return _changed(packet, DESTINATION, self._outer, self._inner)


class PortNat:
    """Changes an inner address and port into an outer address and another port for each remote end, and back.

    Mapping and filtering depend on the remote's address and port (RFC 4787 4.1 and 5; RFC 2663 4.1.2: NAPT), as of the
    routers that give WebRTC the most trouble. It takes TCP and UDP, and no fragments.
    """

    def __init__(self, inner: str, outer: str) -> None:
        self._inner, self._outer = IPv4Address(inner).packed, IPv4Address(outer).packed
        self._outer_ports: dict[_Path, bytes] = {}
        self._inner_ports: dict[_Path, bytes] = {}
        self._given = 0

    def outward(self, packet: bytes) -> bytes | None:
        """Return an IPv4 packet from inside as it is seen outside; None if it does not leave."""
        if not _has_ports(packet):
            return None
        source, destination = _ports(packet)
        end = packet[DESTINATION : DESTINATION + ADDRESS_BYTES], destination
        port = self._outer_ports.get((packet[9], source, *end)) or self._mapped(packet[9], source, *end)
        return _changed(packet, SOURCE, self._inner, self._outer, source, port)

    def inward(self, packet: bytes) -> bytes | None:
        """Return an IPv4 packet from outside as it arrives inside; None if it answers nothing."""
        if not _has_ports(packet):
            return None
        source, destination = _ports(packet)
        inner = self._inner_ports.get((packet[9], destination, packet[SOURCE : SOURCE + ADDRESS_BYTES], source))
        if inner is None:
            return None
        return _changed(packet, DESTINATION, self._outer, self._inner, destination, inner)

    def _mapped(self, protocol: int, source: bytes, remote: bytes, destination: bytes) -> bytes:
        """Give out the next port, and let go of the path that had it."""
        port = (FIRST_PORT + self._given % PORTS).to_bytes(PORT_BYTES, "big")
        self._given += 1
        if len(self._outer_ports) >= PORTS:
            oldest = next(iter(self._outer_ports))
            kind, _, *end = oldest
            del self._inner_ports[kind, self._outer_ports.pop(oldest), end[0], end[1]]
        self._outer_ports[protocol, source, remote, destination] = port
        self._inner_ports[protocol, port, remote, destination] = source
        return port


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


def _has_ports(packet: bytes) -> bool:
    """Whether a packet is of TCP or UDP, and whole."""
    fragment = struct.unpack_from("!H", packet, 6)[0] & 0x3FFF  # without "don't fragment"
    return packet[9] in CHECKSUMS and fragment == 0


def _changed(
    packet: bytes, at: int, old: bytes, new: bytes, old_port: bytes = b"", new_port: bytes = b""
) -> bytes | None:
    """Return the packet with another address at `at` and another port of that end; None: it has another address."""
    if packet[at : at + ADDRESS_BYTES] != old:
        return None
    changed = bytearray(packet)
    changed[at : at + ADDRESS_BYTES] = new
    if new_port:
        port = _header(packet) + (0 if at == SOURCE else PORT_BYTES)
        changed[port : port + PORT_BYTES] = new_port
    _update(changed, HEADER_CHECKSUM, old, new)
    checksum = CHECKSUMS.get(packet[9])
    # Only the first fragment has a header of TCP or UDP; zero says that UDP goes without a checksum.
    if checksum is not None and struct.unpack_from("!H", packet, 6)[0] & 0x1FFF == 0:
        where = _header(packet) + checksum
        if len(packet) >= where + 2 and (packet[9] != socket.IPPROTO_UDP or changed[where : where + 2] != b"\0\0"):
            _update(changed, where, old + old_port, new + new_port)
    return bytes(changed)


def _update(packet: bytearray, at: int, old: bytes, new: bytes) -> None:
    """Update the checksum at `at` after `new` replaced `old`, both of whole 16-bit words (RFC 1624 3)."""
    words = f"!{len(old) // 2}H"
    total = ~struct.unpack_from("!H", packet, at)[0] & 0xFFFF
    for before, after in zip(struct.unpack(words, old), struct.unpack(words, new), strict=True):
        total += (~before & 0xFFFF) + after
    while total >> 16:
        total = (total & 0xFFFF) + (total >> 16)
    struct.pack_into("!H", packet, at, ~total & 0xFFFF)
