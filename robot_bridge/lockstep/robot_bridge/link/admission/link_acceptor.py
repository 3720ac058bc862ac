"""Accepts connections of the robot link, at a bounded rate, and shakes hands for TLS if it is asked for."""

import asyncio
import contextlib
import logging
import socket
import ssl
from collections.abc import Callable
from functools import partial

from lockstep.robot_bridge.link.admission.accepting import accepted, readable
from lockstep.robot_bridge.link.admission.applicants import Applicants
from lockstep.robot_bridge.link.admission.known_addresses import KnownAddresses

__all__ = ["LinkAcceptor", "listening_socket"]

_logger = logging.getLogger(__name__)

HANDSHAKE_TIMEOUT = 2.0  # s
SILENCE = 4.0  # s that a TLS client may take for its first record
PAUSE = 0.1  # s, when the system has no descriptor left
BACKLOG = 128
RATE = 1000.0  # connections accepted per second; the others wait in the kernel, and cost the robot nothing
BURST = 100
HANDSHAKE_RATE = 100.0  # TLS handshakes a second, each a millisecond of the loop, and as many of known addresses
HANDSHAKE_BURST = 20
TLS_HEADER = 5  # bytes of a TLS record, of which the last two are its length (RFC 8446 5.1)
MAX_HELLO = 16 * 1024  # bytes of a record


def listening_socket(host: str, port: int) -> socket.socket:
    """Return a listening socket; an empty `host` listens on all addresses.

    Raises:
        OSError: the address cannot be had.
    """
    if not host and socket.has_dualstack_ipv6():
        return socket.create_server(("", port), family=socket.AF_INET6, dualstack_ipv6=True, backlog=BACKLOG)
    found = {
        each[0] for each in socket.getaddrinfo(host or None, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    }
    family = socket.AF_INET if socket.AF_INET in found else socket.AF_INET6
    return socket.create_server((host, port), family=family, backlog=BACKLOG)


class _Pace:
    """A pace of `rate` a second, `burst` at once; further callers wait in the order in which they came."""

    def __init__(self, rate: float, burst: float) -> None:
        self._rate, self._burst = rate, burst
        self._tokens = burst
        self._filled = 0.0  # s, when tokens were added last
        self._turn = asyncio.Lock()

    async def take(self) -> None:
        async with self._turn:
            now = asyncio.get_running_loop().time()
            self._tokens = min(self._burst, self._tokens + (now - self._filled) * self._rate)
            self._filled = now
            if self._tokens < 1.0:
                await asyncio.sleep((1.0 - self._tokens) / self._rate)
            self._tokens -= 1.0


class LinkAcceptor:
    """Accepts connections of a listening socket, which it owns, while `run` runs.

    `close` ends `run` with the handshakes under way, and the socket.

    TLS begins when the client's first record has arrived whole: a connection that sends less costs only a descriptor.
    Addresses from which a link was admitted before do not wait for the handshakes of others.
    """

    def __init__(
        self,
        listener: socket.socket,
        context: ssl.SSLContext | None,
        factory: Callable[[], asyncio.Protocol],
        failed: Callable[[], None],
        *,
        max_handshakes: int,
        known: KnownAddresses | None = None,
    ) -> None:
        """`failed`: called if a TLS handshake fails.

        `max_handshakes`: connections that may wait for a first record, and as many whose handshake goes on.
        """
        self._listener = listener
        self._context = context
        self._factory = factory
        self._failed = failed
        self._silent: Applicants[asyncio.Task[None]] = Applicants(max_handshakes)
        self._shaking: Applicants[asyncio.Task[None]] = Applicants(max_handshakes)
        self._accepting: asyncio.Task[None] | None = None
        self._closed = False
        self._accepts = _Pace(RATE, BURST)
        self._strangers = _Pace(HANDSHAKE_RATE, HANDSHAKE_BURST)
        self._acquainted = _Pace(HANDSHAKE_RATE, HANDSHAKE_BURST)
        self._known = known or KnownAddresses(None)
        self._is_unwritten = False  # an address was added since the last write began
        self._wake = asyncio.Event()  # there is something to write, or the end has come
        self._is_fault_logged = False
        self._ended = asyncio.Event()  # `run` has ended, or was never called
        self._ended.set()

    async def run(self) -> None:
        """Accept connections until `close`."""
        if self._closed:
            return
        self._listener.setblocking(False)
        self._ended.clear()
        try:
            async with asyncio.TaskGroup() as tasks:
                self._accepting = tasks.create_task(self._accept(), name="link acceptor")
                await self._write_known()
        finally:
            self._ended.set()

    def admitted(self, address: str) -> None:
        """Remember that a link from `address` was admitted."""
        if self._context is not None and self._known.add(address):
            self._is_unwritten = True
            self._wake.set()

    async def _write_known(self) -> None:
        """Write the known addresses whenever there is a new one, until `close`."""
        while self._is_unwritten or not self._closed:
            if self._is_unwritten:
                self._is_unwritten = False
                await asyncio.to_thread(self._known.write)
            else:
                self._wake.clear()
                await self._wake.wait()

    async def close(self) -> None:
        """Stop accepting and close the socket. May be called again."""
        self._closed = True
        try:
            self._wake.set()
            if self._accepting is not None:
                self._accepting.cancel()
            await self._ended.wait()
        finally:  # also if the closing is cancelled: no other code closes the socket
            self._listener.close()

    async def _accept(self) -> None:
        async with asyncio.TaskGroup() as tasks:
            while True:
                await self._accepts.take()
                try:
                    connection, address = await accepted(self._listener)
                except OSError:
                    await asyncio.sleep(PAUSE)
                    continue
                task = tasks.create_task(self._open(connection, address[0]))
                task.add_done_callback(partial(_close_if_cancelled, connection))
                task.add_done_callback(self._silent.remove)
                task.add_done_callback(self._shaking.remove)
                if self._context is not None:
                    self._bound(self._silent, task, address[0])

    def _bound(self, applicants: Applicants[asyncio.Task[None]], task: asyncio.Task[None], address: str) -> None:
        gone = applicants.add(task, address)
        if gone is not None:
            gone.cancel()

    async def _open(self, connection: socket.socket, address: str) -> None:
        loop = asyncio.get_running_loop()
        try:
            connection.setblocking(False)
            if self._context is None:
                await loop.connect_accepted_socket(self._factory, connection)
                return
            await _first_record(connection)
            task = asyncio.current_task()
            assert task is not None  # this coroutine runs in one
            self._silent.remove(task)
            self._bound(self._shaking, task, address)
            await (self._acquainted if address in self._known else self._strangers).take()
            await loop.connect_accepted_socket(
                self._factory, connection, ssl=self._context, ssl_handshake_timeout=HANDSHAKE_TIMEOUT
            )
        except OSError:  # ssl.SSLError and TimeoutError among them
            if self._context is not None:
                self._failed()
            with contextlib.suppress(OSError):
                connection.close()
        except asyncio.CancelledError:
            self._failed()
            raise
        except Exception as error:  # a fault in one connection must not end the bridge, which takes others
            if not self._is_fault_logged:  # a stranger may cause it again and again
                self._is_fault_logged = True
                _logger.error("a connection to the robot link failed: %r", error, exc_info=error)
            self._failed()
            with contextlib.suppress(OSError):
                connection.close()


def _close_if_cancelled(connection: socket.socket, task: asyncio.Task[None]) -> None:
    """Close the connection of a cancelled task, even of one that was cancelled before its first step."""
    if task.cancelled():
        with contextlib.suppress(OSError):
            connection.close()


async def _first_record(connection: socket.socket) -> None:
    """Wait until a whole TLS record can be read.

    Raises:
        OSError: no record arrived in time.
    """
    async with asyncio.timeout(SILENCE):
        await _has_bytes(connection, TLS_HEADER)
        header = connection.recv(TLS_HEADER, socket.MSG_PEEK)
        length = int.from_bytes(header[3:])
        if len(header) < TLS_HEADER or length > MAX_HELLO:
            raise ConnectionAbortedError("no TLS")
        await _has_bytes(connection, TLS_HEADER + length)


async def _has_bytes(connection: socket.socket, count: int) -> None:
    """Wait until `count` bytes are there, or the connection has ended."""
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVLOWAT, count)
    try:
        await readable(connection)
    finally:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVLOWAT, 1)
