import socket
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.emulator.namespace.ip_packets import KEPT, IpKind, IpSorter
from lockstep.protocol.framing import frame
from lockstep.protocol.messages import Hello, LinkRole, Ping, encode_message

ROBOT, OPERATOR = "198.18.0.1", "198.18.0.2"


def ip(protocol: int, payload: bytes, source: str = OPERATOR, target: str = ROBOT) -> bytes:
    header = struct.pack("!BBHHHBBH", 0x45, 0, 20 + len(payload), 0, 0, 64, protocol, 0)
    return header + socket.inet_aton(source) + socket.inet_aton(target) + payload


def udp(data: bytes) -> bytes:
    return ip(socket.IPPROTO_UDP, struct.pack("!HHHH", 1000, 2000, 8 + len(data), 0) + data)


def tcp(data: bytes = b"", *, port: int = 5600, back: bool = False, from_port: int = 40000) -> bytes:
    ports = (port, from_port) if back else (from_port, port)
    segment = struct.pack("!HHIIBBHHH", *ports, 0, 0, 8 << 4, 0, 0, 0, 0) + bytes(12) + data
    return ip(socket.IPPROTO_TCP, segment, *((ROBOT, OPERATOR) if back else (OPERATOR, ROBOT)))


def hello(role: LinkRole) -> bytes:
    return frame(encode_message(Hello(role=role)))


def test_udp_is_sorted_by_its_first_byte() -> None:
    sorter = IpSorter()
    assert [sorter.kind(udp(bytes([first]))) for first in (1, 22, 128)] == ["stun", "control", "media"]
    assert sorter.kind(udp(b"")) == "control"


@pytest.mark.parametrize(
    ("begins", "kind"),
    [
        (hello("media"), "robot_media"),
        (hello("operator"), "robot_control"),
        (hello("events"), "robot_control"),
        (frame(encode_message(Ping(id=1))), "signalling"),
        (b"GET / HTTP/1.1\r\n\r\n", "signalling"),
        (b"\x16\x03\x01", "signalling"),
    ],
)
def test_a_tcp_connection_is_what_it_begins_with_in_both_directions(begins: bytes, kind: IpKind) -> None:
    sorter = IpSorter()
    assert sorter.kind(tcp()) == "signalling", "nothing is known before the first data"
    assert sorter.kind(tcp(begins)) == kind
    assert sorter.kind(tcp(b"more")) == kind
    assert sorter.kind(tcp(b"answer", back=True)) == kind
    assert sorter.kind(tcp(b"other", from_port=40001)) == "signalling"


def test_padding_behind_the_packet_is_no_data() -> None:
    sorter = IpSorter()
    assert sorter.kind(tcp() + b"padding") == "signalling"
    assert sorter.kind(tcp(hello("media"))) == "robot_media"


def test_only_so_many_connections_are_remembered() -> None:
    sorter = IpSorter()
    sorter.kind(tcp(hello("media")))
    for number in range(KEPT):
        sorter.kind(tcp(b"x", port=1 + number, from_port=50000))
    assert sorter.kind(tcp(b"later")) == "signalling"


def test_ipv6_is_no_business_of_ours_and_the_rest_is_control() -> None:
    sorter = IpSorter()
    assert sorter.kind(b"\x60" + bytes(60)) is None
    assert sorter.kind(b"\x45") is None
    assert sorter.kind(ip(socket.IPPROTO_ICMP, b"\x08" + bytes(7))) == "control"


@given(st.binary(max_size=80))
def test_any_bytes_can_be_looked_at(data: bytes) -> None:
    IpSorter().kind(data)
    IpSorter().kind(ip(socket.IPPROTO_TCP, data))
    IpSorter().kind(ip(socket.IPPROTO_UDP, data))
