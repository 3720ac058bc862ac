"""Two network namespaces with an emulated network between them: whole processes run behind it unmodified.

Linux and root only. Every IPv4 packet between the two sides passes a path of the profile; TCP is the kernel's own and
repeats lost packets.
"""

import socket
import time
from typing import Literal

from lockstep.emulator.impairment.bottleneck import Bottleneck
from lockstep.emulator.impairment.outages import Outages
from lockstep.emulator.impairment.path import ImpairedPath
from lockstep.emulator.impairment.profile import DIRECTIONS, Direction, Profile, TwoWay, load_profile
from lockstep.emulator.namespace.ip_packets import IpKind, IpSorter
from lockstep.emulator.namespace.tun_sites import TunSites
from lockstep.emulator.network_statistics import NetworkStatistics, count_queue
from lockstep.emulator.transport.address_translation import Firewall, OneToOneNat

__all__ = ["OPERATOR_ADDRESS", "ROBOT_ADDRESS", "Namespaces", "Side"]

# From the block for tests of networks (RFC 2544).
ROBOT_ADDRESS = "198.18.0.1"
OPERATOR_ADDRESS = "198.18.0.2"

Side = Literal["robot", "operator"]
ADDRESSES: dict[Side, str] = {"robot": ROBOT_ADDRESS, "operator": OPERATOR_ADDRESS}


class Namespaces(TunSites[Side]):
    """Two namespaces. Enter it, then `start` processes on its two sides; leaving ends them.

    The robot's side is `ROBOT_ADDRESS` and usually runs the console; the operator's side is `OPERATOR_ADDRESS`.

    Raises:
        NamespacesUnavailable: on entering; names the missing part.
    """

    def __init__(
        self, profile: Profile | str, *, seed: int = 1, cloud: str | None = None, passes_udp: bool = True
    ) -> None:
        """`passes_udp`: False: the network lets out only TCP. `cloud`: the only address that reaches the robot's side.

        With `cloud` the robot's side is like a machine in a cloud, which only knows its inner address, and the
        operator's side is behind a firewall, like a browser at home.
        """
        super().__init__(ADDRESSES)
        self._nat = OneToOneNat(ROBOT_ADDRESS, cloud) if cloud is not None else None
        self._firewall = Firewall() if cloud is not None else None
        self._passes_udp = passes_udp
        self.profile = load_profile(profile) if isinstance(profile, str) else profile
        self._client_outages = Outages(self.profile.client_outages)
        self._robot_outages = Outages(self.profile.robot_outages)
        self._bottlenecks: dict[Direction, Bottleneck] = {}
        self._paths: dict[tuple[IpKind, Direction], ImpairedPath] = {}
        for direction in DIRECTIONS:
            self._make_paths(direction, seed)
        self._sorter = IpSorter()

    def _make_paths(self, direction: Direction, seed: int) -> None:
        profile = self.profile
        settings = profile.bottleneck(direction)
        if settings is not None:
            self._bottlenecks[direction] = Bottleneck(settings.rate, settings.queue)
        client: dict[IpKind, TwoWay] = {
            "stun": profile.control,
            "control": profile.control,
            "media": profile.media,
            "signalling": profile.signalling,
        }
        robot: dict[IpKind, TwoWay] = {"robot_control": profile.robot_control, "robot_media": profile.robot_media}
        for kind, path in (client | robot).items():
            self._paths[kind, direction] = ImpairedPath(
                path.towards(direction),
                f"{seed} {kind} {direction}",
                self._bottlenecks.get(direction) if kind in client else None,
                self._client_outages if kind in client else self._robot_outages,
            )

    def outage(self, seconds: float, *, hold: bool = False, robot: bool = False) -> None:
        """Begin an outage as `Network.outage` does."""
        (self._robot_outages if robot else self._client_outages).demand(time.monotonic(), seconds, hold=hold)

    def cut_robot(self) -> None:
        """Do nothing: connections belong to the processes on the two sides."""

    def statistics(self) -> NetworkStatistics:
        """Return the statistics of all packets so far."""
        found = NetworkStatistics()
        for (kind, direction), path in self._paths.items():
            found.count(kind, direction, path.statistics)
        for direction, bottleneck in self._bottlenecks.items():
            count_queue(found, direction, bottleneck, time.monotonic())
        return found

    def _left(self, site: Side, packet: bytes) -> None:
        other: Side = "operator" if site == "robot" else "robot"
        direction: Direction = "to_operator" if site == "robot" else "to_robot"
        kind = self._sorter.kind(packet)
        if kind is not None and not self._passes_udp and packet[9] == socket.IPPROTO_UDP:
            return
        if kind is not None:
            packet = self._translated(site, packet)
        if kind is None or packet[16:20] != socket.inet_aton(ADDRESSES[other]):
            return  # IPv6's housekeeping, broadcasts, and packets for other networks
        now = time.monotonic()
        for outages in (self._client_outages, self._robot_outages):
            if not outages.started:
                outages.start(now)
        arrives = self._paths[kind, direction].admit(now, len(packet))
        if arrives is not None:
            self._deliver(other, packet, arrives)

    def _translated(self, side: Side, packet: bytes) -> bytes:
        """Return the packet as it arrives at the other side; b"" if it does not."""
        if self._nat is None or self._firewall is None:
            return packet
        if side == "operator":
            self._firewall.leaving(packet)
            return self._nat.inward(packet) or b""
        outer = self._nat.outward(packet)
        return outer if outer is not None and self._firewall.admits(outer) else b""
