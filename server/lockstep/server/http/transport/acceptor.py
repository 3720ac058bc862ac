"""Accepts connections: each is counted before anything is spent on it, such as TLS or a request."""

import asyncio
import errno
import socket
import ssl
from collections.abc import Callable

from lockstep.robot_bridge.link.admission.accepting import accepted
from lockstep.server.http.transport.client_address import counted_address
from lockstep.server.http.transport.connection_places import ConnectionPlaces, Place
from lockstep.server.util.fair_queue import FairQueue

__all__ = ["PROXIES", "Acceptor", "PlacedProtocol"]

# Proxies whose X-Forwarded-For is believed: uvicorn's default, and 127.0.0.1 as a socket of both families sees it.
PROXIES = frozenset({"127.0.0.1", "::1", "::ffff:127.0.0.1"})
HANDSHAKE_SECONDS = 5.0  # for TLS
PAUSE = 0.1  # s, when there is no descriptor left
LOOK_AGAIN = 0.02  # s, when all places are taken by connections that have just come


class PlacedProtocol(asyncio.Protocol):
    """A connection's protocol that knows its place."""

    place: Place


class Acceptor:
    """Accepts the connections of a listening socket. Run `run` as a task."""

    def __init__(
        self,
        listener: socket.socket,
        places: ConnectionPlaces,
        turns: FairQueue,
        make_protocol: Callable[[], PlacedProtocol],
        tls: ssl.SSLContext | None,
    ) -> None:
        """`turns`: the queue in which connections begin; their input is in it too."""
        self._listener = listener
        self._places = places
        self._turns = turns
        self._make_protocol = make_protocol
        self._tls = tls

    async def run(self) -> None:
        """Accept connections until cancelled; those that have begun by then go on.

        Each has its turn before the next one is accepted: the others wait in the kernel, where they cost nothing and
        where the newest cannot push out one that has not begun, or has had no time to send a request. However many
        strangers' requests wait, it has its turn: a client that comes to send STOP is a stranger until its connection
        has begun.
        """
        async with asyncio.TaskGroup() as tasks:
            while True:
                try:
                    connection, address = await accepted(self._listener)
                except OSError as error:
                    if error.errno in (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM):
                        self._places.on_refused("no_descriptors")
                        await asyncio.sleep(PAUSE)
                    else:
                        await asyncio.sleep(0)  # it was gone before it was accepted
                    continue
                try:
                    await self._turns.begin()
                    await self._until_there_is_room()
                except BaseException:
                    connection.close()
                    raise
                _Beginning(self, connection, str(address[0]), tasks)

    async def _until_there_is_room(self) -> None:
        """Return when there is room, or the connection that has to go has had time to send a request."""
        loop = asyncio.get_running_loop()
        while True:
            wait = self._places.wait(loop.time())
            if wait <= 0:
                return
            await asyncio.sleep(min(wait, LOOK_AGAIN))

    def protocol_at(self, place: Place) -> PlacedProtocol:
        protocol = self._make_protocol()
        protocol.place = place
        return protocol

    async def connect(self, connection: socket.socket, protocol: PlacedProtocol) -> None:
        """Do the TLS handshake, if there is one; asyncio closes the socket if it fails.

        Raises:
            OSError, TimeoutError: the handshake failed.
        """
        await asyncio.get_running_loop().connect_accepted_socket(
            lambda: protocol,
            connection,
            ssl=self._tls,
            ssl_handshake_timeout=None if self._tls is None else HANDSHAKE_SECONDS,
        )

    @property
    def places(self) -> ConnectionPlaces:
        return self._places


class _Beginning:
    """A connection that has no protocol yet, but can be closed all the same."""

    def __init__(self, acceptor: Acceptor, connection: socket.socket, address: str, tasks: asyncio.TaskGroup) -> None:
        self._acceptor = acceptor
        self._connection = connection
        now, proxy = asyncio.get_running_loop().time(), address in PROXIES
        self._place = acceptor.places.enter(counted_address(address), self._close, now, proxy=proxy)
        self._is_handed_over = self._is_connected = False
        self._task: asyncio.Task[None] | None = None
        if self._place.group is None:
            connection.close()
        else:
            self._task = tasks.create_task(self._begin(), name="connection")
            self._task.add_done_callback(self._ended)  # also of a task that is cancelled before its first step

    def _close(self) -> None:
        if self._task is not None:
            self._task.cancel()

    async def _begin(self) -> None:
        try:
            protocol = self._acceptor.protocol_at(self._place)
            self._is_handed_over = True
            await self._acceptor.connect(self._connection, protocol)
            self._is_connected = True
        except (OSError, TimeoutError):
            self._acceptor.places.on_refused("no_handshake")
        except Exception as error:
            loop = asyncio.get_running_loop()
            loop.call_exception_handler({"message": "a connection could not start", "exception": error})

    def _ended(self, task: asyncio.Task[None]) -> None:
        if not self._is_handed_over:
            self._connection.close()
        if not self._is_connected:
            self._acceptor.places.leave(self._place)
