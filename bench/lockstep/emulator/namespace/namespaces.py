"""Two network namespaces with an emulated network between them: whole processes run behind it unmodified.

Linux and root only. Every IPv4 packet between the two sides passes a path of the profile; TCP is the kernel's own and
repeats lost packets.
"""

import asyncio
import os
import signal
import socket
import sys
import time
from collections.abc import Sequence
from contextlib import AsyncExitStack, suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Self

from lockstep.emulator.impairment.bottleneck import Bottleneck
from lockstep.emulator.impairment.deliveries import Deliveries
from lockstep.emulator.impairment.outages import Outages
from lockstep.emulator.impairment.path import ImpairedPath
from lockstep.emulator.impairment.profile import DIRECTIONS, Direction, Profile, TwoWay, load_profile
from lockstep.emulator.namespace.ip_packets import IpKind, IpSorter
from lockstep.emulator.namespace.tun import Tun, open_tun
from lockstep.emulator.network_statistics import NetworkStatistics, count_queue
from lockstep.emulator.transport.address_translation import Firewall, OneToOneNat

__all__ = ["OPERATOR_ADDRESS", "ROBOT_ADDRESS", "Namespaces", "Side", "end_process", "write_packet"]

# From the block for tests of networks (RFC 2544).
ROBOT_ADDRESS = "198.18.0.1"
OPERATOR_ADDRESS = "198.18.0.2"
ENTER = Path(__file__).with_name("enter.py")
MAX_PACKET = 65536
BATCH = 64  # packets read in one turn of the loop
STOP_SECONDS = 10.0

Side = Literal["robot", "operator"]


class Namespaces:
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
        self._sides: dict[Side, Tun] = {}
        self._stack = AsyncExitStack()

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

    async def __aenter__(self) -> Self:
        async with AsyncExitStack() as stack:
            loop = asyncio.get_running_loop()
            self._deliveries = Deliveries()
            stack.callback(self._deliveries.close)
            addresses: dict[Side, str] = {"robot": ROBOT_ADDRESS, "operator": OPERATOR_ADDRESS}
            for side, address in addresses.items():
                tun = await asyncio.to_thread(open_tun, address)
                stack.callback(tun.close)
                self._sides[side] = tun
            for side, tun in self._sides.items():
                loop.add_reader(tun.packets, self._from, side)
                stack.callback(loop.remove_reader, tun.packets)
            self._stack = stack.pop_all()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self._stack.aclose()

    async def start(self, side: Side, command: Sequence[str], **options: Any) -> asyncio.subprocess.Process:
        """Start a process that only knows its side's network; `options` are those of `create_subprocess_exec`."""
        descriptor = self._sides[side].namespace
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-I", str(ENTER), str(descriptor), *command),
            pass_fds=(descriptor,),
            start_new_session=True,
            **options,
        )
        self._stack.push_async_callback(end_process, process)
        return process

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

    def _from(self, side: Side) -> None:
        other = self._sides["operator" if side == "robot" else "robot"]
        direction: Direction = "to_operator" if side == "robot" else "to_robot"
        for _ in range(BATCH):
            try:
                packet = os.read(self._sides[side].packets, MAX_PACKET)
            except OSError:
                return
            kind = self._sorter.kind(packet)
            if kind is not None and not self._passes_udp and packet[9] == socket.IPPROTO_UDP:
                continue
            if kind is not None:
                packet = self._translated(side, packet)
            if kind is None or packet[16:20] != _packed(other.address):
                continue  # IPv6's housekeeping, broadcasts, and packets for other networks
            now = time.monotonic()
            for outages in (self._client_outages, self._robot_outages):
                if not outages.started:
                    outages.start(now)
            arrives = self._paths[kind, direction].admit(now, len(packet))
            if arrives is not None:
                self._deliveries.at(arrives, write_packet, other.packets, packet)

    def _translated(self, side: Side, packet: bytes) -> bytes:
        """Return the packet as it arrives at the other side; b"" if it does not."""
        if self._nat is None or self._firewall is None:
            return packet
        if side == "operator":
            self._firewall.leaving(packet)
            return self._nat.inward(packet) or b""
        outer = self._nat.outward(packet)
        return outer if outer is not None and self._firewall.admits(outer) else b""


def write_packet(descriptor: int, packet: bytes) -> None:
    """Write a packet to a TUN device that may be gone."""
    with suppress(OSError):  # the queue is full, or the device is closed
        os.write(descriptor, packet)


def _packed(address: str) -> bytes:
    return bytes(int(part) for part in address.split("."))


async def end_process(process: asyncio.subprocess.Process) -> None:
    """End the process and all that it started."""
    for number in (signal.SIGTERM, signal.SIGKILL):
        with suppress(ProcessLookupError):
            os.killpg(process.pid, number)
        with suppress(TimeoutError):
            async with asyncio.timeout(STOP_SECONDS):
                await process.wait()
