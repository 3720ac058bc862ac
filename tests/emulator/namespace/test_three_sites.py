"""The routers of three sites: only answers come in, but for the console's open port; robot and page never meet."""

import socket
import struct

import pytest

from lockstep.emulator.namespace.three_sites import CONSOLE, Router, Site

PORT = 8000
ROBOT_INSIDE, CONSOLE_INSIDE, PAGE_INSIDE = "10.0.1.2", "10.0.2.2", "10.0.3.2"
ROBOT_OUTSIDE, PAGE_OUTSIDE = "198.18.0.1", "198.18.0.3"


def packet(source: str, to: str, ports: tuple[int, int], protocol: int = socket.IPPROTO_UDP) -> bytes:
    header = struct.pack("!BBHHHBBH4s4s", 0x45, 0, 28, 0, 0, 64, protocol, 0, *map(socket.inet_aton, (source, to)))
    return header + struct.pack("!HHHH", *ports, 8, 0)


def ports(data: bytes) -> tuple[int, int]:
    source, destination = struct.unpack_from("!HH", data, 20)
    return source, destination


def ends(data: bytes) -> tuple[str, str]:
    return socket.inet_ntoa(data[12:16]), socket.inet_ntoa(data[16:20])


@pytest.mark.parametrize(
    ("site", "inside", "outside"), [("robot", ROBOT_INSIDE, ROBOT_OUTSIDE), ("page", PAGE_INSIDE, PAGE_OUTSIDE)]
)
def test_the_open_port_is_reached_and_its_answers_find_the_way_back(site: Site, inside: str, outside: str) -> None:
    router = Router(PORT)
    passed = router.passes(site, packet(inside, CONSOLE, (5000, PORT)))
    assert passed is not None
    assert (passed[0], ends(passed[1])) == ("console", (outside, CONSOLE_INSIDE))
    seen, _ = ports(passed[1])
    assert seen != 5000, "the router gives out ports of its own"
    back = router.passes("console", packet(CONSOLE_INSIDE, outside, (PORT, seen)))
    assert back is not None
    assert (back[0], ends(back[1]), ports(back[1])) == (site, (CONSOLE, inside), (PORT, 5000))


def test_no_other_port_is_reached_nor_a_site_that_did_not_ask() -> None:
    router = Router(PORT)
    assert router.passes("page", packet(PAGE_INSIDE, CONSOLE, (5000, 22), socket.IPPROTO_TCP)) is None
    assert router.passes("console", packet(CONSOLE_INSIDE, ROBOT_OUTSIDE, (PORT, 5000))) is None
    assert router.refused == {"console": 1, "robot": 1}


def test_robot_and_page_never_meet_and_inner_addresses_lead_nowhere() -> None:
    router = Router(PORT)
    assert router.passes("page", packet(PAGE_INSIDE, ROBOT_OUTSIDE, (5000, PORT))) is None
    assert router.passes("page", packet(PAGE_INSIDE, CONSOLE_INSIDE, (5000, PORT))) is None
    assert router.passes("page", b"\x60" + bytes(40)) is None
