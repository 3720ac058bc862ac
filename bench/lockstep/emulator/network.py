"""A network between real processes on this machine, without root, for experiments and tests."""

import asyncio
import socket
import time
from collections.abc import Sequence
from contextlib import AsyncExitStack
from types import TracebackType
from typing import Self
from urllib.parse import urlsplit

from aioice.ice import get_host_addresses

from lockstep.emulator.impairment.deliveries import Deliveries
from lockstep.emulator.impairment.outages import Outages
from lockstep.emulator.impairment.profile import Profile, load_profile
from lockstep.emulator.network_statistics import NetworkStatistics, collect
from lockstep.emulator.transport.client_paths import SignallingPaths
from lockstep.emulator.transport.http_proxy import ConsoleProxy
from lockstep.emulator.transport.sessions import Sessions
from lockstep.emulator.transport.tcp_forwarder import TcpForwarder
from lockstep.emulator.transport.udp_forwarder import LOOPBACK, UdpForwarder
from lockstep.server.http.transport.serve import bind, running

__all__ = ["Network"]


class Network:
    """An emulated network. Clients open its `console_url`; a console connects to its `robot_address`.

    >>> async with Network(load_profile("hong-kong"), console_url="http://127.0.0.1:8000", seed=1) as network:
    ...     browser.open(network.link("http://127.0.0.1:8000/#token=…"))

    The schedule of outages starts with the first packet of the first client; `begin` starts it again.

    Args:
        profile: a profile, or the name or file of one
        console_url: the console; None if `open_console` is called later, or never
        robot: host and port of a robot bridge; None: the robot link stays direct
        seed: the same seed meets each client, in the order of their arrival, with the same network
        hosts: this machine's addresses at which clients find the forwarder; None: loopback and the IPv4 addresses
        host, port: address of the proxy
    """

    def __init__(
        self,
        profile: Profile | str,
        *,
        console_url: str | None = None,
        robot: tuple[str, int] | None = None,
        seed: int = 1,
        hosts: Sequence[str] | None = None,
        host: str = LOOPBACK,
        port: int = 0,
    ) -> None:
        self.profile = load_profile(profile) if isinstance(profile, str) else profile
        self.console_url = ""  # the proxy's
        self.robot_address = ""  # the forwarder's, "tcp://127.0.0.1:40000"
        self._console = console_url
        self._robot = robot
        self._seed = seed
        self._hosts = hosts
        self._listen = host, port
        self._client_outages = Outages(self.profile.client_outages)
        self._robot_outages = Outages(self.profile.robot_outages)
        self._signalling = SignallingPaths(self.profile, str(seed), self._client_outages)
        self._proxied = False
        self._forwarder: TcpForwarder | None = None
        self._stack = AsyncExitStack()

    async def __aenter__(self) -> Self:
        hosts = self._hosts if self._hosts is not None else await asyncio.to_thread(_own_hosts)
        async with AsyncExitStack() as stack:
            self._deliveries = Deliveries()
            stack.callback(self._deliveries.close)
            self._sessions = Sessions(self.profile, self._seed, self._client_outages, self._deliveries, hosts)
            stack.callback(self._sessions.close)
            if self._robot is not None:
                forwarder = TcpForwarder(self._robot, self.profile, self._seed, self._robot_outages, self._deliveries)
                self._forwarder = await stack.enter_async_context(forwarder)
                self.robot_address = "tcp://{}:{}".format(*forwarder.address)
            self._stack = stack.pop_all()
        try:
            if self._console is not None:
                await self.open_console(self._console)
        except BaseException:
            await self._stack.aclose()
            raise
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self._stack.aclose()

    async def open_console(self, url: str) -> str:
        """Put a proxy in front of the console at `url`, once, and return the proxy's URL."""
        if self._proxied:
            raise RuntimeError("this network has a console already")
        self._proxied = True
        parts = urlsplit(url)
        proxy = ConsoleProxy(f"{parts.scheme}://{parts.netloc}", self._sessions, self._signalling)
        self._stack.push_async_callback(proxy.close)
        listener = bind(*self._listen)
        self._stack.callback(listener.close)
        await self._stack.enter_async_context(running(proxy.app, listener))
        self.console_url = "http://{}:{}".format(*listener.getsockname()[:2])
        return self.console_url

    def link(self, link: str) -> str:
        """Return the console's link `http://host:port/#token=…`, through this network."""
        return urlsplit(link)._replace(scheme="http", netloc=urlsplit(self.console_url).netloc).geturl()

    def open_forwarder(self) -> UdpForwarder:
        """Open a separate forwarder between two peers whose descriptions the caller leads through it."""
        forwarder = self._sessions.open()
        self._sessions.keep(f"own {id(forwarder)}", forwarder)
        return forwarder

    def begin(self) -> None:
        """Start the schedule of outages now."""
        now = time.monotonic()
        self._client_outages.start(now)
        self._robot_outages.start(now)

    def outage(self, seconds: float, *, hold: bool = False, robot: bool = False) -> None:
        """Let nothing pass for `seconds` from now on.

        Args:
            hold: packets wait in the network and arrive at its end; else they are lost
            robot: on the robot link; else between clients and the console
        """
        outages = self._robot_outages if robot else self._client_outages
        outages.demand(time.monotonic(), seconds, hold=hold)

    def cut_robot(self) -> None:
        """Break the connections of the robot link."""
        if self._forwarder is not None:
            self._forwarder.cut()

    def statistics(self) -> NetworkStatistics:
        """Return the statistics of all packets so far."""
        robot = {} if self._forwarder is None else self._forwarder.statistics
        return collect(self._sessions.all_paths, self._signalling.statistics, robot, time.monotonic())


def _own_hosts() -> list[str]:
    own = get_host_addresses(use_ipv4=True, use_ipv6=False)
    return [LOOPBACK, *(each for each in own if each != LOOPBACK and _ours(each))]


def _ours(host: str) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as trial:
        try:
            trial.bind((host, 0))
        except OSError:
            return False
    return True
