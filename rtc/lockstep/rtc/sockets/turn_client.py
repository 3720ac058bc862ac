"""Connections to STUN and TURN servers on asyncio."""

import asyncio
import secrets
from collections import Counter
from collections.abc import Callable, Iterable
from typing import cast

from lockstep.rtc.addresses import Address, Path
from lockstep.rtc.sockets.core_timer import CoreTimer
from lockstep.rtc.turn.allocation import Allocated, Allocation
from lockstep.rtc.turn.messages import TurnStream
from lockstep.rtc.turn.servers import IceServer, ServerUri

__all__ = ["TurnClient", "TurnRefused", "open_turn_client"]

OnData = Callable[[Iterable[tuple[bytes, Path]]], None]  # takes datagrams that came together, each with its path

MAX_UNSENT = 256 * 1024  # bytes that wait on a TCP connection to a server; further data is lost, as UDP would lose it


class TurnRefused(ConnectionError):
    """The server gives no address. `code` is STUN's (RFC 8656 19): 401 for bad credentials, 408 for silence."""

    def __init__(self, code: int, reason: str) -> None:
        super().__init__(code, reason)
        self.code = code
        self.reason = reason

    def __str__(self) -> str:
        return f"{self.code} {self.reason}".strip()


class TurnClient(asyncio.Protocol, asyncio.DatagramProtocol):
    """One allocation and the socket to its server. `relayed` is the address for peers; None before and after the
    allocation. `counts` has dropped datagrams, by reason.
    """

    def __init__(self, uri: ServerUri, server: IceServer, on_data: OnData) -> None:
        self._loop = asyncio.get_running_loop()
        self._reliable = uri.transport == "tcp"
        self._core = Allocation(
            server.username or "", server.credential or "", secrets.token_bytes, reliable=self._reliable
        )
        self.counts: Counter[str] = self._core.counts
        self.mapped: Address | None = None  # the address of this side, as the server sees it
        self.answered: asyncio.Future[None] = self._loop.create_future()
        self._on_data = on_data
        self._stream = TurnStream()
        self._transport: asyncio.BaseTransport | None = None
        self._timer = CoreTimer(self._core, self._flush, self._fail)

    @property
    def relayed(self) -> Address | None:
        return self._core.relayed

    def send(self, data: bytes, peer: Address) -> None:
        self._core.send(data, peer, self._loop.time())
        self._flush()

    def close(self) -> None:
        """Give the address back. Idempotent."""
        self._core.close(self._loop.time())
        self._flush()
        if self._transport is not None:
            self._transport.close()
        if not self.answered.done():
            self.answered.cancel()

    # Callbacks of asyncio

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = transport
        self._core.start(self._loop.time())
        self._flush()

    def data_received(self, data: bytes) -> None:
        for message in self._stream.receive_bytes(data):
            self._core.receive(message, self._loop.time())
        self._flush()
        if self._stream.broken and self._transport is not None:
            self._transport.close()

    def datagram_received(self, data: bytes, addr: object) -> None:
        self._core.receive(data, self._loop.time())
        self._flush()

    def error_received(self, exc: Exception) -> None:
        self.counts["socket_error"] += 1  # of ICMP; the request is repeated

    def connection_lost(self, exc: Exception | None) -> None:
        self._core.close(self._loop.time())
        if not self.answered.done():
            self.answered.set_exception(TurnRefused(408, "the connection was closed"))
        self._timer.close()

    # Inside

    def _fail(self, error: Exception) -> None:
        self._loop.call_exception_handler({"message": "a fault in the timer of a TURN allocation", "exception": error})
        self.close()  # else it would fail again at once, for ever

    def _flush(self) -> None:
        relayed = self._core.relayed
        received = self._core.received()
        if received and relayed is not None:
            self._on_data([(data, Path(relayed, peer)) for data, peer in received])
        for event in self._core.events():
            if self.answered.done():
                continue  # its end is no news: consent tells whether the path is good
            if isinstance(event, Allocated):
                self.mapped = event.mapped
                self.answered.set_result(None)
            else:
                self.answered.set_exception(TurnRefused(event.error.code, event.error.reason))
        for message in self._core.data_to_send():
            self._write(message)
        self._timer.set()

    def _write(self, message: bytes) -> None:
        if self._transport is None or self._transport.is_closing():
            self.counts["no_connection"] += 1
        elif not self._reliable:
            cast(asyncio.DatagramTransport, self._transport).sendto(message)
        elif cast(asyncio.WriteTransport, self._transport).get_write_buffer_size() > MAX_UNSENT:
            self.counts["backlog"] += 1
        else:
            cast(asyncio.WriteTransport, self._transport).write(message)


async def open_turn_client(uri: ServerUri, server: IceServer, on_data: OnData) -> TurnClient:
    """Return an address on a TURN server. `on_data` gets the datagrams that arrive there, with their paths.

    Raises:
        TurnRefused: the server refuses, or does not answer.
        OSError: it cannot be reached.
    """
    loop = asyncio.get_running_loop()
    client = TurnClient(uri, server, on_data)
    try:
        if uri.transport == "udp":
            await loop.create_datagram_endpoint(lambda: client, remote_addr=(uri.host, uri.port))
        else:
            await loop.create_connection(lambda: client, uri.host, uri.port, ssl=True if uri.tls else None)
        await client.answered
    except BaseException:
        client.close()
        raise
    return client
