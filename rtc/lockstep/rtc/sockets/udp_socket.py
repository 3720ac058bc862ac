"""One UDP socket that does not block: answers leave from the address that was asked, and frames leave in one call.

It is part of the shell around the cores, and decides nothing but the order: urgent datagrams leave before others.

Where the kernel has UDP_SEGMENT (Linux 4.18), datagrams of one size to one address leave as one message that the kernel
cuts: a quarter of the time for each. `sendmmsg` on top of that saves nothing, and `recvmmsg` 5 to 30 % of what little
is received, so that neither is here: `socket` has all that this needs (`make bench ARGS=datagrams`).
"""

import errno
import socket
import struct
from collections import Counter, deque
from collections.abc import Iterable, Iterator
from itertools import chain
from typing import NamedTuple, Self, TypeVar

from lockstep.rtc.addresses import Address, Datagram, Path

__all__ = ["MAX_BACKLOG", "MAX_DATAGRAM", "UdpSocket"]

MAX_DATAGRAM = 2048  # bytes that come in: more than a path of Ethernet carries
MAX_BATCH = 64  # datagrams of one `receive`, so that a fast sender does not keep others waiting
MAX_BACKLOG = 2048  # datagrams of each kind that wait for the kernel: 50 ms at 40,000 a second
MAX_SEGMENTS = 64  # of one message (UDP_MAX_SEGMENTS of older kernels)
MAX_MESSAGE = 65000  # bytes of one message before it is cut, below the maximum of IPv4's length field
MAX_REFUSALS = 100  # messages that the kernel would not cut, until nothing is combined any more
MAX_KNOWN = 4096  # paths that are remembered; strangers' come and go
BUFFER_BYTES = 1 << 21  # of the kernel, each way: pictures for hundreds of peers; it may grant less

SOL_UDP, UDP_SEGMENT = 17, 103  # linux/udp.h; `socket` names neither
IP_PKTINFO = getattr(socket, "IP_PKTINFO", 8)  # Python 3.11 does not name it
FULL = (errno.EAGAIN, errno.EWOULDBLOCK, errno.ENOBUFS)
UNCUT = (errno.EINVAL, errno.EIO, errno.EMSGSIZE)  # the interface cannot cut, or its MTU has become smaller

Key = TypeVar("Key")
Value = TypeVar("Value")
Ancillary = tuple[int, int, bytes]  # level, type, value


class Message(NamedTuple):
    """One datagram, or several of one size to one address, of which the last may be shorter."""

    datagrams: list[bytes]
    path: Path


class UdpSocket:
    """`queue` datagrams and `flush` once a turn; `arriving` when the socket is readable, `flush` when `wants_write`.

    A datagram that the kernel refuses (EPERM of a firewall, ENETUNREACH of a network that is gone, …) is dropped and
    counted in `counts` by the error's name. When more than `MAX_BACKLOG` wait, the oldest of their kind are dropped.
    """

    def __init__(self, sock: socket.socket, *, segments: bool = True) -> None:
        """`segments`: False: one system call for each datagram."""
        sock.setblocking(False)
        self._socket = sock
        host, port = sock.getsockname()[:2]
        self.address: Address = (host, port)
        self.counts: Counter[str] = Counter()
        self._urgent: deque[Datagram] = deque()
        self._others: deque[Datagram] = deque()
        self._any_address = host in ("0.0.0.0", "::") and _tells_local_addresses(sock)
        self._segments = segments and _supports_segments(sock)
        self.is_full = False  # the kernel took no more, and has not since
        self._refused = 0  # messages that the kernel would not cut
        self._alone = 0  # number of the next datagrams that leave uncombined: the kernel has refused to cut them
        self._paths: dict[tuple[object, bytes], Path] = {}  # by sender and packet information
        self._origins: dict[str, list[Ancillary]] = {}  # by the address to leave from

    @classmethod
    def bind(cls, host: str, port: int, *, segments: bool = True) -> Self:
        """Open a socket.

        Args:
            host: An IP address; `0.0.0.0` and `::` are all of their version.
            port: 0: any that is free.

        Raises:
            OSError: as `socket.bind`.
        """
        sock = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_DGRAM)
        try:
            if sock.family == socket.AF_INET6:
                sock.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
            for option in (socket.SO_RCVBUF, socket.SO_SNDBUF):
                sock.setsockopt(socket.SOL_SOCKET, option, BUFFER_BYTES)
            sock.bind((host, port))
            return cls(sock, segments=segments)
        except BaseException:
            sock.close()
            raise

    def fileno(self) -> int:
        return self._socket.fileno()

    def close(self) -> None:
        self._socket.close()
        self._urgent.clear()
        self._others.clear()

    # Input

    def receive(self) -> list[tuple[bytes, Path]]:
        """Return the datagrams that have come, at most `MAX_BATCH`. Errors of the socket are counted."""
        return list(self.arriving())

    def arriving(self) -> Iterator[tuple[bytes, Path]]:
        """Yield what `receive` returns. The kernel is asked for each datagram when the caller wants it: a command has
        gone on before the call that finds nothing more."""
        for _ in range(MAX_BATCH):
            try:
                data, ancillary, _, sender = self._socket.recvmsg(MAX_DATAGRAM + 1, 64)
            except OSError as error:
                self._count(error)
                break
            if len(data) > MAX_DATAGRAM:
                self.counts["too_long"] += 1
                continue
            key = (sender, ancillary[0][2] if ancillary else b"")
            path = self._paths.get(key)
            if path is None:
                path = _remember(self._paths, key, Path(self._local(key[1]), _address(sender)))
            yield data, path

    def _local(self, information: bytes) -> Address:
        """Return the address that a datagram came to, from in_pktinfo or in6_pktinfo."""
        host, port = self.address
        if self._socket.family == socket.AF_INET and len(information) == 12:
            host = socket.inet_ntoa(information[8:])
        elif self._socket.family == socket.AF_INET6 and len(information) == 20:
            host = socket.inet_ntop(socket.AF_INET6, information[:16])
        return host, port

    # Output

    @property
    def wants_write(self) -> bool:
        """True if something waits until the kernel has room."""
        return bool(self._urgent or self._others)

    def queue(self, datagrams: Iterable[Datagram], *, urgent: bool = False) -> None:
        queue, name = (self._urgent, "backlog_urgent") if urgent else (self._others, "backlog")
        queue.extend(datagrams)
        while len(queue) > MAX_BACKLOG:
            queue.popleft()  # the oldest datagram is worth least
            self.counts[name] += 1

    def send_at_once(self, datagram: Datagram) -> bool:
        """Send one urgent datagram before all that wait. Return False, and `queue` it, if urgent ones wait already or
        the kernel takes no more."""
        if self._urgent:
            return False
        data, path = datagram
        try:
            if ancillary := self._origin(path.local[0]):
                self._socket.sendmsg((data,), ancillary, 0, path.remote)
            else:
                self._socket.sendto(data, path.remote)
        except OSError as error:
            if error.errno in FULL:
                self.is_full = True
                return False
            self._count(error)
        self.is_full = False
        return True

    def flush(self) -> None:
        """Send the waiting datagrams, urgent ones first, until the kernel takes no more."""
        while self.wants_write and self._send(self._next_message()):
            pass

    def _next_message(self) -> Message:
        """Return the next datagram, and others that can leave with it."""
        waiting = chain(self._urgent, self._others)
        first = next(waiting)
        message = Message([first.data], first.path)
        if not self._segments or self._alone or self._refused >= MAX_REFUSALS:
            return message
        size = len(first.data)
        room = MAX_MESSAGE - size
        for data, path in waiting:
            if path != first.path or len(message.datagrams) == MAX_SEGMENTS or not 0 < len(data) <= min(size, room):
                break
            message.datagrams.append(data)
            room -= len(data)
            if len(data) < size:
                break
        return message

    def _send(self, message: Message) -> bool:
        """Send a message. Return False if the kernel takes no more."""
        datagrams, path = message
        try:
            ancillary = self._origin(path.local[0])
            if len(datagrams) > 1:
                ancillary = [*ancillary, (SOL_UDP, UDP_SEGMENT, struct.pack("=H", len(datagrams[0])))]
            if ancillary:
                self._socket.sendmsg(datagrams, ancillary, 0, path.remote)
            else:
                self._socket.sendto(datagrams[0], path.remote)
        except OSError as error:
            if error.errno in FULL:
                self.is_full = True
                return False
            if len(datagrams) > 1 and error.errno in UNCUT:
                self.counts["segments_refused"] += 1
                self._refused += 1
                self._alone = len(datagrams)
                return True
            self._count(error)
        self.is_full = False
        for _ in datagrams:
            (self._urgent or self._others).popleft()
        self._alone = max(0, self._alone - len(datagrams))
        return True

    def _origin(self, host: str) -> list[Ancillary]:
        """Return the packet information that makes a datagram leave from that local address.

        Raises:
            OSError: not an IP address of this socket's version.
        """
        if not self._any_address or host == self.address[0]:
            return []
        found = self._origins.get(host)
        if found is None:
            if self._socket.family == socket.AF_INET:
                value = bytes(4) + socket.inet_aton(host) + bytes(4)
                found = [(socket.IPPROTO_IP, IP_PKTINFO, value)]
            else:
                value = socket.inet_pton(socket.AF_INET6, host) + bytes(4)
                found = [(socket.IPPROTO_IPV6, socket.IPV6_PKTINFO, value)]
            _remember(self._origins, host, found)
        return found

    def _count(self, error: OSError) -> None:
        if error.errno not in (errno.EAGAIN, errno.EWOULDBLOCK):
            self.counts[errno.errorcode.get(error.errno or 0, "unsendable")] += 1


def _address(sender: tuple[str, int] | tuple[str, int, int, int]) -> Address:
    """Return the address; for IPv6 with the zone, without which a link-local address means nothing."""
    host, port = sender[:2]
    zone = sender[3] if len(sender) == 4 else 0
    return (f"{host}%{zone}" if zone and "%" not in host else host), port


def _tells_local_addresses(sock: socket.socket) -> bool:
    """Ask the kernel for the local address at which each datagram arrived. Return False if it has no such option."""
    try:
        if sock.family == socket.AF_INET:
            sock.setsockopt(socket.IPPROTO_IP, IP_PKTINFO, 1)
        else:
            sock.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_RECVPKTINFO, 1)
    except OSError:
        return False
    return True


def _supports_segments(sock: socket.socket) -> bool:
    try:
        sock.getsockopt(SOL_UDP, UDP_SEGMENT)
    except OSError:
        return False
    return True


def _remember(entries: dict[Key, Value], key: Key, value: Value) -> Value:
    if len(entries) >= MAX_KNOWN:
        entries.clear()  # a peer that is still there sends another datagram
    entries[key] = value
    return value
