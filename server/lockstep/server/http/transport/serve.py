"""Runs the app on uvicorn, and tells when it is ready."""

import asyncio
import contextlib
import os
import signal
import socket
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from typing import Any, cast

import uvicorn
from starlette.applications import Starlette

from lockstep.server.http.transport.acceptor import PROXIES, Acceptor, PlacedProtocol
from lockstep.server.http.transport.tls import Certificate
from lockstep.server.http.transport.uvicorn_http_limits import MAX_HEAD, BoundedConnections
from lockstep.server.http.transport.uvicorn_websocket_limits import bounded_websocket

__all__ = ["PortTaken", "bind", "running", "stop_signals", "wait_for_signal"]

BACKLOG = 1024  # connections that wait to be accepted; a flood of them may come before a STOP
SHUTDOWN_TIMEOUT = 3  # s for HTTP requests under way
MAX_WEBSOCKET_MESSAGE = 64 * 1024  # bytes from a viewer of the scene, or from an observer


class PortTaken(Exception):
    def __init__(self, host: str, port: int, reason: str) -> None:
        super().__init__(host, port, reason)
        self.host = host
        self.port = port
        self.reason = reason

    def __str__(self) -> str:
        return f"cannot listen on {self.host}:{self.port}: {self.reason}"


def bind(host: str, port: int) -> socket.socket:
    """Return a listening socket; port 0 takes any free one.

    Raises:
        PortTaken: the port is in use, or the address is not this machine's.
    """
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        listener = socket.socket(family, kind, protocol)
    except OSError as error:
        raise PortTaken(host, port, error.strerror or str(error)) from error
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(address)
        listener.listen(BACKLOG)
        listener.setblocking(False)
    except OSError as error:
        listener.close()
        raise PortTaken(host, port, error.strerror or str(error)) from error
    return listener


class _Server(uvicorn.Server):
    """A uvicorn server that tells when it is ready, and leaves the signals to its caller."""

    def __init__(
        self,
        config: uvicorn.Config,
        bounded: BoundedConnections | None,
        listener: socket.socket,
        tasks: asyncio.TaskGroup,
    ) -> None:
        super().__init__(config)
        self.settled = asyncio.Event()  # set when it answers, or has failed
        self._tasks: asyncio.TaskGroup = tasks
        self._bounded = bounded
        self._listener = listener
        self._accepting: asyncio.Task[None] | None = None
        self._fault: Exception | None = None  # of accepting connections

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        try:
            await super().startup(sockets if self._bounded is None else [])
            if self._bounded is not None and not self.should_exit:
                self._accept(self._bounded)
        finally:
            self.settled.set()

    def _accept(self, bounded: BoundedConnections) -> None:
        """Accept connections in place of uvicorn, which takes any number, and tells of each after its TLS handshake."""
        loop = asyncio.get_running_loop()

        def make_protocol() -> PlacedProtocol:
            config: Any = self.config
            return cast(
                PlacedProtocol,
                config.http_protocol_class(
                    config=config, server_state=self.server_state, app_state=self.lifespan.state, _loop=loop
                ),
            )

        acceptor = Acceptor(self._listener, bounded.places, bounded.turns, make_protocol, self.config.ssl)
        self._accepting = self._tasks.create_task(self._run(acceptor), name="accept")

    async def _run(self, acceptor: Acceptor) -> None:
        """Accept until cancelled. A fault shuts the server down gracefully; `serve` then raises it."""
        try:
            await acceptor.run()
        except Exception as error:
            self._fault = error
            self.should_exit = True

    async def serve(self, sockets: list[socket.socket] | None = None) -> None:
        await super().serve(sockets)
        if self._fault is not None:
            raise self._fault

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        if self._accepting is not None:
            self._accepting.cancel()
            await asyncio.wait((self._accepting,))
        await super().shutdown(sockets)
        for connection in list(self.server_state.connections):  # as of a client that does not answer the end of TLS
            connection.transport.abort()
        await asyncio.sleep(0)  # then their sockets are closed

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        yield


@asynccontextmanager
async def running(
    app: Starlette,
    listener: socket.socket,
    *,
    http: BoundedConnections | None = None,
    tls: Certificate | None = None,
) -> AsyncIterator[None]:
    """Serve `app` on `listener` while entered; shut it down gracefully on leaving.

    Args:
        http: connections with bounds; None: uvicorn's own, without
        tls: the certificate to encrypt with; None: nothing is encrypted

    Raises:
        ExceptionGroup: it failed, which cancels the block. An exception of the block comes out as it is, and so does
            that of a server that does not start.
    """
    config = uvicorn.Config(
        app,
        access_log=False,  # a path can hold a ticket
        log_level="error",  # uvicorn warns of every request that is not HTTP; the console counts them
        lifespan="on",
        ws=bounded_websocket(),
        ws_max_size=MAX_WEBSOCKET_MESSAGE,
        forwarded_allow_ips=os.environ.get("FORWARDED_ALLOW_IPS") or sorted(PROXIES),
        timeout_graceful_shutdown=SHUTDOWN_TIMEOUT,
        server_header=False,
        http="h11" if http is None else http.protocol,
        h11_max_incomplete_event_size=MAX_HEAD,
        ssl_certfile=None if tls is None else tls.chain,
        ssl_keyfile=None if tls is None else tls.key,
    )
    failure: BaseException | None = None
    started = False
    try:
        async with asyncio.TaskGroup() as tasks:
            server = _Server(config, http, listener, tasks)
            serving = tasks.create_task(server.serve([listener]), name="http")
            try:
                await server.settled.wait()
                if not server.started:
                    raise RuntimeError("the console did not start")
                started = True
                yield
            except BaseException as error:
                failure = error  # raised behind the group, which would wrap it
            server.should_exit = True
            await asyncio.wait((serving,))
    except BaseExceptionGroup as errors:
        if started:
            raise
        raise errors.exceptions[0] from None  # the caller says what is wrong with its settings
    try:
        if failure is not None:
            raise failure
    finally:
        del failure  # which refers to this frame


async def wait_for_signal() -> None:
    """Wait for a signal to stop."""
    with stop_signals() as asked:
        await asked.wait()


@contextlib.contextmanager
def stop_signals() -> Iterator[asyncio.Event]:
    """Set the event, while entered, at SIGINT, SIGTERM, or the end of the terminal unless that is ignored (`nohup`).

    The next signal has its usual effect: it ends a process that does not come to its end.
    """
    loop, asked = asyncio.get_running_loop(), asyncio.Event()
    signals = [signal.SIGINT, signal.SIGTERM]
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
        signals.append(signal.SIGHUP)

    def leave() -> None:
        for number in signals:
            loop.remove_signal_handler(number)

    def ask() -> None:
        asked.set()
        leave()

    for number in signals:
        loop.add_signal_handler(number, ask)
    try:
        yield asked
    finally:
        leave()
