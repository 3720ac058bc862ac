"""ICE restart under a connection that lives on (RFC 8445 9, RFC 8842 5.1), which neither aiortc nor aioice has.

A restart gathers a second ICE connection beside the first. Both feed the one queue that DTLS reads from, so nothing
that arrives is lost; once the second is connected, DTLS, SCTP and SRTP send through it and the first is closed. DTLS
has authenticated the peer and goes on doing so, whatever path its datagrams take. If the second never connects, nothing
has changed.

A browser may receive on its old path and answer no check there once it has moved to the new one. So while a restart is
under way, consent that expires on the old path (RFC 7675) stops what is sent there and ends nothing: that is decided
when the new path is found, or is not.

Private parts of aiortc and aioice that are used; tests pin every one of them:

- `RTCIceGatherer._connection`, `._remote_candidates_end`, `RTCIceTransport._connection`, `._recv`, `._send`: what DTLS
  sends and receives with
- `RTCDtlsTransport._state`: whether DTLS is connected
- `RTCIceTransport.__monitor_task`, `._monitor`: it takes the end of the connection that it watches for the end of all
- `aioice.Connection._queue`, `._query_consent_task`: the receive queue, and the checks that would end an old connection
"""

import asyncio
import secrets
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import structlog
from aioice.ice import Connection, StunProtocol
from aiortc import RTCDtlsTransport, RTCIceCandidate, RTCIceGatherer, RTCPeerConnection
from aiortc.rtcdtlstransport import State
from aiortc.rtcicetransport import RTCIceTransport, candidate_to_aioice

from robot_bridge.protocol.ice_consent import keep_consent, require_consent_hooks
from server.peer_guards_private import guard_ice
from server.to_the_end import to_the_end

__all__ = ["IceSession", "LocalIce", "keep_path"]

log = structlog.get_logger(__name__)
require_consent_hooks(Connection, StunProtocol)

MAX_CANDIDATES = 100  # of the peer, in one session
LINGER = 2.0  # s in which datagrams on the old path still count
MONITOR = "_RTCIceTransport__monitor_task"  # mangled: aiortc has no way to watch another connection


class LocalIce(NamedTuple):
    """Our side of a new ICE session."""

    username: str
    password: str
    candidates: list[RTCIceCandidate]


class _DataOnly:
    """A receive queue that passes datagrams on, and not the None by which a connection says that it has ended."""

    def __init__(self, queue: Any) -> None:
        self._queue = queue

    def put_nowait(self, item: tuple[bytes, int] | None) -> None:
        if item is not None:
            self._queue.put_nowait(item)


class IceSession:
    """The ICE side of one peer connection. Call `close` at its end.

    Attributes:
        tag: entity tag of the newest ICE session (RFC 9725 4.3.1); a restart changes it
        lapsed: set while consent has expired on the current path and a restart is under way
    """

    def __init__(
        self,
        pc: RTCPeerConnection,
        username: str,
        gatherer: Callable[[], RTCIceGatherer],
        connect_timeout: float,
        on_refused: Callable[[str], None],
    ) -> None:
        """`on_refused` gets the name of what a peer had too much of."""
        self.tag = _new_tag()
        self.username = username  # the peer's, of the newest session
        self._dtls = _dtls_of(pc)
        self._transport = _transport_of(pc)
        self._gatherer = gatherer
        self._connect_timeout = connect_timeout
        self._on_refused = on_refused
        self._candidates = 0
        self._closed = False
        self._restarting = asyncio.Lock()
        self._next: Any = None  # the connection that is to take over
        self._taking_over: asyncio.Task[None] | None = None
        self.lapsed = asyncio.Event()
        # Called when the peer has answered no check of the current path for 30 s; the connection closes then.
        self.on_expired: Callable[[], None] = lambda: None
        if self._transport is not None:
            self._prepare(self._transport._connection)
        self._lingering: set[asyncio.Task[None]] = set()

    @property
    def connected(self) -> bool:
        return self._transport is not None and not self._closed and self._transport.state == "completed"

    async def restart(self, username: str, password: str, candidates: Sequence[RTCIceCandidate]) -> LocalIce:
        """Begin a new session with the peer's new credentials; a restart under way is given up for it.

        Returns when our side is gathered; the change of paths follows by itself.

        Raises:
            ConnectionError: not connected, or not any more.
        """
        async with self._restarting:  # aioice does not take being closed while it gathers
            if self._transport is None or not self.connected:
                raise ConnectionError("there is no ICE session that could be restarted")
            await self._give_up()
            gatherer = self._gatherer()
            connection: Any = gatherer._connection
            self._prepare(connection)
            connection._queue = _DataOnly(_queue_of(self._transport))
            self._next, self._candidates = connection, 0
            try:
                await to_the_end(gatherer.gather())
                # The offerer keeps the role it has (RFC 8445 6.1.1); a conflict would repair itself.
                connection.ice_controlling = self._transport._connection.ice_controlling
                connection.remote_username, connection.remote_password = username, password
                for candidate in candidates:
                    await self.add_candidate(candidate)
            except BaseException:
                await self._give_up()
                await self._end_if_lapsed()
                raise
            self.tag, self.username = _new_tag(), username
            local = gatherer.getLocalParameters()
            self._taking_over = asyncio.get_running_loop().create_task(self._take_over(connection), name="ice restart")
            return LocalIce(local.usernameFragment or "", local.password or "", gatherer.getLocalCandidates())

    async def add_candidate(self, candidate: RTCIceCandidate) -> bool:
        """One more candidate of the peer, for the newest session. False: it has too many already."""
        self._candidates += 1
        if self._candidates > MAX_CANDIDATES:
            return False
        if self._next is not None:
            await self._next.add_remote_candidate(candidate_to_aioice(candidate))
        elif self._transport is not None:
            await self._transport.addRemoteCandidate(candidate)
        return True

    async def close(self) -> None:
        """Idempotent; the connection that is current is the peer connection's to close."""
        self._closed = True
        async with self._restarting:
            await self._give_up()
        for task in self._lingering:
            task.cancel()
        await asyncio.gather(*self._lingering, return_exceptions=True)

    def _prepare(self, connection: Any) -> None:
        guard_ice(connection, self._on_refused, self._is_secured)
        keep_consent(connection, lambda: self._expired(connection))

    def _is_secured(self) -> bool:
        return self._dtls is not None and self._dtls._state is State.CONNECTED

    def _expired(self, connection: Any) -> bool:
        """Whether the connection stays open, silent, for a restart that is under way."""
        if self._transport is None or self._transport._connection is not connection:
            return False
        if self._next is None:
            self.on_expired()
            return False
        log.info("ice consent expired while a restart is under way")
        self.lapsed.set()
        self._transport._send = _send_nothing
        return True

    async def _end_if_lapsed(self) -> None:
        """No path is left."""
        if self.lapsed.is_set() and self._transport is not None:
            self.lapsed.clear()
            self.on_expired()
            await self._transport._connection.close()

    async def _give_up(self) -> None:
        """End the session that has not taken over."""
        task, self._taking_over = self._taking_over, None
        if task is not None:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)
        connection, self._next = self._next, None
        if connection is not None:
            await connection.close()

    async def _take_over(self, connection: Any) -> None:
        """Wait for the new path, then move to it."""
        try:
            async with asyncio.timeout(self._connect_timeout):
                await connection.connect()
        except (ConnectionError, TimeoutError):
            log.info("ice restart found no path", old_path="expired" if self.lapsed.is_set() else "stays")
            self._next = None
            await connection.close()
            await self._end_if_lapsed()
            return
        if self._transport is None or self._transport.state != "completed":
            return  # it ended meanwhile; `close` follows
        old = _swap(self._transport, connection)
        self._next = None
        self.lapsed.clear()
        task = asyncio.get_running_loop().create_task(_close_later(old), name="ice linger")
        self._lingering.add(task)
        task.add_done_callback(self._lingering.discard)


def keep_path(pc: RTCPeerConnection) -> None:
    """The same patience with checks for a connection without an `IceSession`. Call before it connects."""
    transport = _transport_of(pc)
    if transport is not None:
        keep_consent(transport._connection)


def _dtls_of(pc: RTCPeerConnection) -> RTCDtlsTransport | None:
    """The one transport: all sections are bundled."""
    for transceiver in pc.getTransceivers():
        return transceiver.receiver.transport
    return None if pc.sctp is None else pc.sctp.transport


def _transport_of(pc: RTCPeerConnection) -> RTCIceTransport | None:
    dtls = _dtls_of(pc)
    return None if dtls is None else dtls.transport


def _queue_of(transport: Any) -> Any:
    return transport._connection._queue


def _swap(transport: Any, connection: Any) -> Any:
    """Let DTLS send and receive through `connection`; what it used until now."""
    old = transport._connection
    if not hasattr(transport, MONITOR):
        raise RuntimeError("aiortc moved RTCIceTransport.__monitor_task; see server/ice_restart_private.py")
    monitor = getattr(transport, MONITOR)
    if monitor is not None:
        monitor.cancel()
    connection._queue, old._queue = old._queue, _DataOnly(old._queue)
    transport.iceGatherer._connection = connection
    transport.iceGatherer._remote_candidates_end = False
    transport._connection = connection
    transport._recv = connection.recv
    transport._send = connection.send
    setattr(transport, MONITOR, asyncio.ensure_future(transport._monitor()))
    if old._query_consent_task is not None:
        old._query_consent_task.cancel()
    return old


async def _send_nothing(data: bytes) -> None:
    """For DTLS, on a path without consent; what it carries is repeated, or too old."""


async def _close_later(connection: Any) -> None:
    try:
        await asyncio.sleep(LINGER)
    finally:
        await connection.close()


def _new_tag() -> str:
    return f'"{secrets.token_hex(8)}"'
