"""Three namespaces, each behind a router of its own: a robot, a console with one open port, and a page.

Linux and root only. The routers of robot and page give each way out a port of their own and let in its answers alone
(RFC 4787: address and port-dependent), as the routers of homes and of mobile networks that are hardest to pass. The
console's keeps ports, and forwards its open one. The robot's path to the console is one profile's robot link, the
page's is another's network of a client; between robot and page there is no path.
"""

import socket
import struct
import time
from collections import Counter
from dataclasses import dataclass
from typing import Literal

from lockstep.emulator.impairment.bottleneck import Bottleneck
from lockstep.emulator.impairment.outages import Outages
from lockstep.emulator.impairment.path import ImpairedPath
from lockstep.emulator.impairment.profile import DIRECTIONS, Direction, Profile
from lockstep.emulator.namespace.tun_sites import TunSites
from lockstep.emulator.transport.address_translation import Firewall, OneToOneNat, PortNat

__all__ = ["CONSOLE", "SITES", "Router", "Site", "ThreeSites"]

Site = Literal["robot", "console", "page"]
INNER: dict[Site, str] = {"robot": "10.0.1.2", "console": "10.0.2.2", "page": "10.0.3.2"}  # private (RFC 1918)
OUTER: dict[Site, str] = {"robot": "198.18.0.1", "console": "198.18.0.2", "page": "198.18.0.3"}  # RFC 2544
SITES: tuple[Site, ...] = ("robot", "console", "page")
CONSOLE = OUTER["console"]


class Router:
    """Translates the packets of one site for another, as a NAT does. No I/O.

    Attributes:
        refused: packets that a site's router has not let in, by site
    """

    def __init__(self, open_port: int) -> None:
        """`open_port`: of the console, for TCP and UDP."""
        self.refused: Counter[Site] = Counter()
        self._open_port = open_port
        self._nats: dict[Site, OneToOneNat | PortNat] = {
            "robot": PortNat(INNER["robot"], OUTER["robot"]),
            "console": OneToOneNat(INNER["console"], CONSOLE),
            "page": PortNat(INNER["page"], OUTER["page"]),
        }
        self._firewall = Firewall()  # the console's
        self._by_address = {socket.inet_aton(address): site for site, address in OUTER.items()}

    def passes(self, site: Site, packet: bytes) -> tuple[Site, bytes] | None:
        """Return the site that gets an IPv4 packet, and the packet as it arrives there; None if nobody gets it."""
        if len(packet) < 24 or packet[0] >> 4 != 4:
            return None
        outer = self._nats[site].outward(packet)
        other = self._by_address.get(packet[16:20])
        if outer is None or other is None or other == site or "console" not in (site, other):
            return None
        if site == "console":
            self._firewall.leaving(outer)
        admitted = other != "console" or self._firewall.admits(outer) or self._is_for_open_port(outer)
        inner = self._nats[other].inward(outer) if admitted else None
        if inner is None:
            self.refused[other] += 1
            return None
        return other, inner

    def _is_for_open_port(self, packet: bytes) -> bool:
        port: int = struct.unpack_from("!H", packet, (packet[0] & 15) * 4 + 2)[0]
        return packet[9] in (socket.IPPROTO_TCP, socket.IPPROTO_UDP) and port == self._open_port


@dataclass(frozen=True)
class _Leg:
    """The paths between one site and the console."""

    paths: dict[Direction, ImpairedPath]
    outages: Outages


class ThreeSites(TunSites[Site]):
    """Enter it, then `start` processes at its sites; leaving ends them.

    Raises:
        NamespacesUnavailable: on entering; names the missing part.
    """

    def __init__(self, robot: Profile, page: Profile, open_port: int, *, seed: int = 1) -> None:
        """`robot` and `page`: the networks between these sites and the console."""
        super().__init__(INNER)
        self.router = Router(open_port)
        self._legs: dict[Site, _Leg] = {"robot": _robot_leg(robot, seed), "page": _page_leg(page, seed)}

    def outage(self, site: Literal["robot", "page"], seconds: float) -> None:
        """Lose every packet between a site and the console from now on, for `seconds`."""
        self._legs[site].outages.demand(time.monotonic(), seconds)

    def planned_silence(self, site: Literal["robot", "page"], began: float, ended: float) -> float:
        """Return the seconds of the profile's own outages between two monotonic times."""
        return self._legs[site].outages.planned_seconds(began, ended)

    def sent_bytes(self, site: Site, direction: Direction) -> int:
        """Return the bytes that a site's path to the console has taken in one direction."""
        return self._legs[site].paths[direction].statistics.bytes

    def _left(self, site: Site, packet: bytes) -> None:
        passed = self.router.passes(site, packet)
        if passed is None:
            return
        other, arriving = passed
        leg = self._legs[other if site == "console" else site]
        now = time.monotonic()
        if not leg.outages.started:
            leg.outages.start(now)
        towards_person: Direction = "to_operator" if (site == "robot" or other == "page") else "to_robot"
        arrives = leg.paths[towards_person].admit(now, len(packet))
        if arrives is not None:
            self._deliver(other, arriving, arrives)


def _robot_leg(profile: Profile, seed: int) -> _Leg:
    outages = Outages(profile.robot_outages)
    paths: dict[Direction, ImpairedPath] = {}
    for direction in DIRECTIONS:
        settings = profile.robot_bottleneck(direction)
        bottleneck = None if settings is None else Bottleneck(settings.rate, settings.queue)
        name = f"{seed} robot {direction}"
        paths[direction] = ImpairedPath(profile.robot_media.towards(direction), name, bottleneck, outages)
    return _Leg(paths, outages)


def _page_leg(profile: Profile, seed: int) -> _Leg:
    outages = Outages(profile.client_outages)
    paths: dict[Direction, ImpairedPath] = {}
    for direction in DIRECTIONS:
        settings = profile.bottleneck(direction)
        bottleneck = None if settings is None else Bottleneck(settings.rate, settings.queue)
        paths[direction] = ImpairedPath(
            profile.media.towards(direction), f"{seed} page {direction}", bottleneck, outages
        )
    return _Leg(paths, outages)
