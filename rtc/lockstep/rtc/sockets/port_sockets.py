"""The sockets of one port number: UDP at each local address, and TCP beside it where peers may use that."""

import asyncio
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence

from lockstep.rtc.addresses import Address, Datagram, Path
from lockstep.rtc.sockets.tcp_port import TcpPort
from lockstep.rtc.sockets.udp_socket import UdpSocket

__all__ = ["PortSockets"]

UNSENT = 64 * 1024  # bytes on a TCP path; above that pictures should wait, where newer ones replace them
PORT_TRIES = 8  # a free port of one address may be taken at another


class PortSockets:
    """Binds the sockets, reads them, and empties their queues. `hosts` are the addresses in use, the preferred ones
    first; iterate for all UDP sockets."""

    def __init__(self, receive: Callable[[Iterable[tuple[bytes, Path]]], None], tcp: TcpPort | None) -> None:
        """`receive`: called with the datagrams that come together, each with its path."""
        self.by_address: dict[Address, UdpSocket] = {}
        self.hosts: list[str] = []
        self.number = 0
        self.tcp = tcp
        self.flush_is_due = False
        self._receive = receive
        self._loop = asyncio.get_running_loop()
        self._full = set[UdpSocket]()  # sockets for which the loop watches whether the kernel has room again

    def __iter__(self) -> Iterator[UdpSocket]:
        return iter(self.by_address.values())

    def bind_all(self, hosts: Sequence[str], number: int) -> None:
        """Bind one port at these addresses; 0: a free one. Raises OSError."""
        for left in reversed(range(PORT_TRIES)):
            self.number = number
            try:
                for host in hosts:
                    self._bind(host)
                break
            except OSError:
                self.close()
                if number or not left:
                    raise
        self.hosts = list(hosts)

    def _bind(self, host: str) -> None:
        found = UdpSocket.bind(host, self.number)
        self.by_address[found.address] = found
        self.number = found.address[1]
        self._loop.add_reader(found.fileno(), self._readable, found)
        if self.tcp is not None:
            self.tcp.bind(host, self.number)

    def use_hosts(self, hosts: Sequence[str], counts: Counter[str]) -> None:
        """As `Endpoint.use_hosts`; `counts` has addresses that cannot be bound."""
        known = {address[0] for address in self.by_address}
        for host in hosts:
            if host not in known:
                try:
                    self._bind(host)
                except OSError:
                    counts["host_not_bound"] += 1
        bound = {address[0] for address in self.by_address}
        self.hosts = [host for host in hosts if host in bound]

    def _readable(self, found: UdpSocket) -> None:
        self._receive(found.arriving())

    def is_blocked(self, path: Path) -> bool:
        """True if data sent on this path now would only wait for the network."""
        if path.transport == "tcp":
            return self.tcp is not None and self.tcp.unsent(path) > UNSENT
        found = self.by_address.get(path.local)
        return found is not None and found.is_full

    def send_at_once(self, datagram: Datagram) -> bool:
        """Send a datagram by UDP, without the queues; return False if it has to take its turn there."""
        if datagram.path.transport == "tcp":
            return False
        found = self.by_address.get(datagram.path.local)
        return found is not None and found.send_at_once(datagram)

    def flush_later(self) -> None:
        """Empty the queues at the end of this turn of the loop."""
        self.flush_is_due = True
        self._loop.call_soon(self._flush_due)

    def _flush_due(self) -> None:
        self.flush_is_due = False
        self.flush()

    def flush(self) -> None:
        """Empty the queues now."""
        for found in self:
            self.flush_socket(found)

    def flush_socket(self, found: UdpSocket) -> None:
        found.flush()
        if found.wants_write:
            self._loop.add_writer(found.fileno(), self.flush)
            self._full.add(found)
        elif self._full and found in self._full:
            self._loop.remove_writer(found.fileno())
            self._full.remove(found)

    def close(self) -> None:
        """Send what waits, and close all. Idempotent."""
        if self.tcp is not None:
            self.tcp.close()
        self.flush()
        for found in self:
            self._loop.remove_reader(found.fileno())
            self._loop.remove_writer(found.fileno())
            found.close()
        self.by_address.clear()
        self._full.clear()
