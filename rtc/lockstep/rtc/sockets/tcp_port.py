"""TCP connections that peers open to this machine (RFC 6544, passive): the shell for networks that let no UDP out.

A connection is a path like any other: datagrams in frames (RFC 4571 2), checked by ICE. Until a check on it is
authentic it belongs to a stranger: few at a time, each for a few seconds, and the oldest gives way to the next.
"""

import asyncio
import socket
from collections import Counter
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import cast

from lockstep.rtc.addresses import Address, Datagram, Path
from lockstep.rtc.ice.tcp import TcpFraming, frame
from lockstep.rtc.token_bucket import TokenBucket

__all__ = ["TcpPort", "TcpPortSettings"]

BACKLOG = 128
PAUSE = 0.1  # s; the pause when the system has no descriptor left, or too many connect
TCP_NOTSENT_LOWAT = getattr(socket, "TCP_NOTSENT_LOWAT", 25)  # linux/tcp.h; Python does not name it everywhere
KERNEL_UNSENT = 32 * 1024  # bytes; further data waits here, where it is counted and bounded
READ, STRANGER_READ = 4 * 1024, 2 * 1024  # bytes in one turn of the loop; a frame may have two, without data
STRANGER_BYTES, STRANGER_DATAGRAMS = 8 * 1024, 50  # of a connection without an authentic check: checks alone
EMPTY_RATE, EMPTY_BURST = 10.0, 100.0  # Hz, of frames without data, which somebody may send to keep a path open


@dataclass(frozen=True, slots=True)
class TcpPortSettings:
    connections: int = 1024  # of peers and strangers; each has a descriptor
    accept_rate: float = 200.0  # connections a second in the long run; more wait in the system's queue, or are refused
    accept_burst: float = 100.0  # connections at once
    strangers: int = 64  # connections on which no check has been authentic
    patience: float = 10.0  # s until a stranger is closed, or a connection that no session uses any more
    unsent: int = 128 * 1024  # bytes that wait for the network; further data is lost, as UDP would lose it
    unsent_urgent: int = 256 * 1024  # the same of urgent datagrams, for which there is room when others have filled it


class TcpPort:
    """Accepts TCP connections of peers. `counts` has dropped datagrams and refused connections, by reason."""

    def __init__(
        self,
        receive: Callable[[Iterable[tuple[bytes, Path]]], None],
        closed: Callable[[Path], None],
        is_used: Callable[[Path], bool],
        settings: TcpPortSettings | None = None,
    ) -> None:
        """Prepare to listen; `bind` does so.

        Args:
            receive: called with the datagrams that came together, each with its path.
            closed: called when the connection of a path has ended.
            is_used: returns True if a session has heard its peer on a path.
        """
        self.settings = settings or TcpPortSettings()
        self.counts: Counter[str] = Counter()
        self.receive = receive
        self.closed = closed
        self.is_used = is_used
        self._loop = asyncio.get_running_loop()
        self._listeners: dict[Address, socket.socket] = {}
        self._accepting: set[asyncio.Task[object]] = set()
        self._accepts = TokenBucket(self.settings.accept_rate, self.settings.accept_burst)
        self._connections: dict[Path, _TcpPath] = {}
        self._strangers: dict[Path, _TcpPath] = {}  # the oldest first; some may be used by now

    def bind(self, host: str, port: int) -> None:
        """Listen at this address. Raises OSError."""
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        listener = socket.create_server((host, port), family=family, backlog=BACKLOG)
        listener.setblocking(False)
        self._listeners[host, port] = listener
        self._loop.add_reader(listener, self._accept, listener)

    def send(self, datagram: Datagram, *, urgent: bool) -> None:
        """Send a datagram; drop and count it where the connection has ended, or too much waits for it."""
        found = self._connections.get(datagram.path)
        if found is None:
            self.counts["no_connection"] += 1
        elif not found.send(datagram.data, self.settings.unsent_urgent if urgent else self.settings.unsent):
            self.counts["backlog"] += 1

    def unsent(self, path: Path) -> int:
        """Return the number of bytes that wait for the network on this path."""
        found = self._connections.get(path)
        return 0 if found is None else found.unsent

    def close(self) -> None:
        """Close all connections; data that were sent still leave. Idempotent."""
        for listener in self._listeners.values():
            self._loop.remove_reader(listener)
            listener.close()
        self._listeners.clear()
        for task in self._accepting:
            task.cancel()
        for each in list(self._connections.values()):
            each.close()

    # For connections

    def opened(self, connection: "_TcpPath") -> None:
        self._connections[connection.path] = connection
        if len(self._connections) > self.settings.connections:
            self.counts["too_many_connections"] += 1
            connection.abort()
            return
        self._strangers[connection.path] = connection
        if len(self._strangers) > self.settings.strangers:
            self._strangers = {path: each for path, each in self._strangers.items() if not self.is_used(path)}
        if len(self._strangers) > self.settings.strangers:
            self.counts["too_many_strangers"] += 1
            self._strangers.pop(next(iter(self._strangers))).abort()

    def ended(self, connection: "_TcpPath") -> None:
        self._strangers.pop(connection.path, None)
        if self._connections.pop(connection.path, None) is not None:
            self.closed(connection.path)

    # Inside

    def _accept(self, listener: socket.socket) -> None:
        if not self._accepts.take(self._loop.time()):
            self.counts["put_off"] += 1
            self._pause(listener)
            return
        try:
            connection, _ = listener.accept()
        except (BlockingIOError, ConnectionAbortedError):
            return
        except OSError:  # no descriptor, or no memory
            self.counts["not_accepted"] += 1
            self._pause(listener)
            return
        connection.setblocking(False)
        with suppress(OSError):  # a system that has no such option
            connection.setsockopt(socket.IPPROTO_TCP, TCP_NOTSENT_LOWAT, KERNEL_UNSENT)
        # No group: this is a callback of the loop. The task hands the connection to the loop, which takes one step.
        task: asyncio.Task[object] = self._loop.create_task(self._open(connection), name="ice-tcp")
        self._accepting.add(task)
        task.add_done_callback(self._accepting.discard)
        task.add_done_callback(partial(_close_if_cancelled, connection))

    def _pause(self, listener: socket.socket) -> None:
        self._loop.remove_reader(listener)
        self._loop.call_later(PAUSE, self._listen_again, listener)

    def _listen_again(self, listener: socket.socket) -> None:
        if listener in self._listeners.values():
            self._loop.add_reader(listener, self._accept, listener)

    async def _open(self, connection: socket.socket) -> None:
        try:
            await self._loop.connect_accepted_socket(lambda: _TcpPath(self), connection)
        except OSError:  # the peer has gone
            connection.close()


def _close_if_cancelled(connection: socket.socket, task: asyncio.Task[object]) -> None:
    """Close the connection of a cancelled task, also where it was cancelled before its first step."""
    if task.cancelled():
        connection.close()


class _TcpPath(asyncio.BufferedProtocol):
    """One connection. Little of it is read in one turn: an event loop's own read holds 130,000 frames without data."""

    path: Path
    _transport: asyncio.Transport

    def __init__(self, port: TcpPort) -> None:
        self._port = port
        self._framing = TcpFraming()
        self._loop = asyncio.get_running_loop()
        self._look: asyncio.TimerHandle | None = None
        self._buffer = memoryview(bytearray(STRANGER_READ))
        self._is_stranger = True
        self._bytes = self._datagrams = 0  # that the stranger has sent
        self._empties = TokenBucket(EMPTY_RATE, EMPTY_BURST)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.Transport, transport)  # uvloop's is not an instance of it
        local, remote = (transport.get_extra_info(name)[:2] for name in ("sockname", "peername"))
        self.path = Path(local, remote, "tcp")
        self._look_later()
        self._port.opened(self)

    def get_buffer(self, sizehint: int) -> memoryview:
        return self._buffer

    def buffer_updated(self, nbytes: int) -> None:
        before = self._framing.counts["empty_frame"]
        datagrams = self._framing.receive_bytes(bytes(self._buffer[:nbytes]))
        fault = self._fault(nbytes, len(datagrams), self._framing.counts["empty_frame"] - before)
        if datagrams and not fault:
            self._port.receive([(each, self.path) for each in datagrams])
        if self._framing.too_long:
            fault = "frame_too_long"
        if fault:
            self._port.counts[fault] += 1
            self.abort()

    def _fault(self, size: int, datagrams: int, empty: int) -> str:
        """Return the name of what nobody sends; "" for the rest."""
        if self._is_stranger and self._port.is_used(self.path):
            self._is_stranger = False
            self._buffer = memoryview(bytearray(READ))
        if self._is_stranger:
            self._bytes += size
            self._datagrams += datagrams
            if self._bytes > STRANGER_BYTES or self._datagrams > STRANGER_DATAGRAMS:
                return "too_much_of_a_stranger"
        now = self._loop.time()
        if empty > self._empties.level(now):
            return "too_many_empty_frames"
        self._empties.overdraw(empty, now)
        return ""

    def connection_lost(self, error: Exception | None) -> None:
        if self._look is not None:
            self._look.cancel()
        self._port.ended(self)

    @property
    def unsent(self) -> int:
        return self._transport.get_write_buffer_size()

    def send(self, data: bytes, most: int) -> bool:
        """Send a datagram. Return False if too much waits."""
        if self.unsent > most:
            return False
        self._transport.write(frame(data))
        return True

    def close(self) -> None:
        self._transport.close()
        self._loop.call_later(self._port.settings.patience, self._transport.abort)  # for a peer that does not read

    def abort(self) -> None:
        self._transport.abort()

    def _look_later(self) -> None:
        self._look = self._loop.call_later(self._port.settings.patience, self._look_now)

    def _look_now(self) -> None:
        if self._port.is_used(self.path):
            self._look_later()
        else:
            self._port.counts["unused"] += 1
            self.abort()
