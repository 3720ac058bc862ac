"""NAT and firewall of the emulator, on packets that the kernel would take."""

import socket
import struct
from ipaddress import IPv4Address

from lockstep.emulator.transport.address_translation import PORTS, Firewall, OneToOneNat, PortNat

INNER, OUTER, HOME = "198.18.0.1", "203.0.113.1", "198.18.0.2"
NAT = OneToOneNat(INNER, OUTER)


def checksum(data: bytes) -> int:
    """RFC 1071."""
    data += b"\0" * (len(data) % 2)
    total: int = sum(struct.unpack(f"!{len(data) // 2}H", data))
    while total >> 16:
        total = (total & 0xFFFF) + (total >> 16)
    return ~total & 0xFFFF


def packet(
    source: str, destination: str, protocol: int = socket.IPPROTO_UDP, ports: tuple[int, int] = (5000, 6000)
) -> bytes:
    ends = IPv4Address(source).packed + IPv4Address(destination).packed
    at = 6 if protocol == socket.IPPROTO_UDP else 16
    body = bytearray(struct.pack("!HH", *ports) + bytes(16) + b"odd")
    body = body if protocol == socket.IPPROTO_TCP else bytearray(struct.pack("!HHHH", *ports, 13, 0) + b"hello")
    struct.pack_into("!H", body, at, checksum(ends + struct.pack("!HH", protocol, len(body)) + bytes(body)))
    head = bytearray(struct.pack("!BBHHHBBH", 0x45, 0, 20 + len(body), 7, 0, 64, protocol, 0) + ends)
    struct.pack_into("!H", head, 10, checksum(bytes(head)))
    return bytes(head + body)


def test_only_the_address_changes_and_checksums_stay_right() -> None:
    for protocol in (socket.IPPROTO_UDP, socket.IPPROTO_TCP):
        assert NAT.outward(packet(INNER, HOME, protocol)) == packet(OUTER, HOME, protocol)
        assert NAT.inward(packet(HOME, OUTER, protocol)) == packet(HOME, INNER, protocol)


def test_nobody_outside_reaches_the_inner_address() -> None:
    assert NAT.inward(packet(HOME, INNER)) is None
    assert NAT.outward(packet(HOME, OUTER)) is None


def test_a_packet_of_udp_without_a_checksum_stays_without() -> None:
    bare = bytearray(packet(INNER, HOME))
    bare[26:28] = b"\0\0"
    out = NAT.outward(bytes(bare))
    assert out is not None
    assert out[26:28] == b"\0\0"


def test_a_router_gives_each_way_out_a_port_of_its_own_and_checksums_stay_right() -> None:
    for protocol in (socket.IPPROTO_UDP, socket.IPPROTO_TCP):
        nat = PortNat(INNER, OUTER)
        seen = []
        for port in (6000, 6001):
            out = nat.outward(packet(INNER, HOME, protocol, (5000, port)))
            assert out is not None
            seen.append(int.from_bytes(out[20:22], "big"))
            assert out == packet(OUTER, HOME, protocol, (seen[-1], port))
            assert nat.inward(packet(HOME, OUTER, protocol, (port, seen[-1]))) == packet(
                HOME, INNER, protocol, (port, 5000)
            )
        assert len({5000, *seen}) == 3
        assert nat.outward(packet(INNER, HOME, protocol, (5000, 6000))) == packet(
            OUTER, HOME, protocol, (seen[0], 6000)
        )


def test_a_router_lets_in_answers_alone_and_only_from_the_end_that_was_asked() -> None:
    nat = PortNat(INNER, OUTER)
    out = nat.outward(packet(INNER, HOME, ports=(5000, 6000)))
    assert out is not None
    seen = int.from_bytes(out[20:22], "big")
    assert nat.inward(packet(HOME, OUTER, ports=(6000, seen))) is not None
    assert nat.inward(packet(HOME, OUTER, ports=(6001, seen))) is None
    assert nat.inward(packet(INNER, OUTER, ports=(6000, seen))) is None
    assert nat.inward(packet(HOME, OUTER, socket.IPPROTO_TCP, (6000, seen))) is None
    fragment = bytearray(packet(INNER, HOME))
    fragment[6] = 0x20  # more fragments follow
    assert nat.outward(bytes(fragment)) is None


def test_a_router_that_has_given_out_all_ports_lets_go_of_the_oldest_way() -> None:
    nat = PortNat(INNER, OUTER)
    first = nat.outward(packet(INNER, HOME, ports=(1, 1)))
    assert first is not None
    seen = int.from_bytes(first[20:22], "big")
    for number in range(1, PORTS + 1):
        last = nat.outward(packet(INNER, HOME, ports=(2 + number // 60000, 2 + number % 60000)))
    assert nat.inward(packet(HOME, OUTER, ports=(1, seen))) is None
    assert last is not None
    assert int.from_bytes(last[20:22], "big") == seen


def test_the_firewall_lets_in_what_answers_and_nothing_else() -> None:
    firewall = Firewall()
    answer = packet(OUTER, HOME, ports=(6000, 5000))
    assert not firewall.admits(answer)
    firewall.leaving(packet(HOME, OUTER))
    assert firewall.admits(answer)
    assert not firewall.admits(packet(OUTER, HOME, ports=(6001, 5000)))
    assert not firewall.admits(packet(INNER, HOME, ports=(6000, 5000)))
    assert not firewall.admits(packet(OUTER, HOME, socket.IPPROTO_TCP, (6000, 5000)))
