"""Runs the app on uvicorn, and says when it is ready."""

import asyncio
import contextlib
import signal
import socket
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager

import uvicorn
from starlette.applications import Starlette

from server.guarded_websocket import GuardedWebSocket
from server.tls import Certificate

__all__ = ["PortTaken", "bind", "running", "wait_for_signal"]

BACKLOG = 128
SHUTDOWN_TIMEOUT = 3  # s for HTTP requests under way
MAX_HEAD = 16 * 1024  # bytes of a request's head
MAX_WEBSOCKET_MESSAGE = 64 * 1024  # bytes from a viewer of the scene, or from a watcher


class PortTaken(Exception):
    def __init__(self, host: str, port: int, reason: str) -> None:
        super().__init__(host, port, reason)
        self.host = host
        self.port = port
        self.reason = reason

    def __str__(self) -> str:
        return f"cannot listen on {self.host}:{self.port}: {self.reason}"


def bind(host: str, port: int) -> socket.socket:
    """A listening socket; port 0 takes any free one.

    Raises:
        PortTaken: somebody else has it, or the address is not ours.
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
    """Says when it is ready, and leaves the signals to its caller."""

    def __init__(self, config: uvicorn.Config) -> None:
        super().__init__(config)
        self.settled = asyncio.Event()  # it answers, or it has failed

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        try:
            await super().startup(sockets)
        finally:
            self.settled.set()

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        yield


@asynccontextmanager
async def running(
    app: Starlette,
    listener: socket.socket,
    *,
    http: type[asyncio.Protocol] | None = None,
    tls: Certificate | None = None,
) -> AsyncIterator[None]:
    """While entered, `app` answers on `listener`; on leaving it shuts down gracefully.

    Args:
        http: the protocol of its connections; None is uvicorn's own
        tls: what it encrypts with; None: nothing is encrypted
    """
    config = uvicorn.Config(
        app,
        access_log=False,  # a path can hold a ticket
        log_level="error",  # uvicorn warns of every request that is not HTTP; we count them
        lifespan="on",
        ws=GuardedWebSocket,
        ws_max_size=MAX_WEBSOCKET_MESSAGE,
        timeout_graceful_shutdown=SHUTDOWN_TIMEOUT,
        server_header=False,
        http=http or "h11",
        h11_max_incomplete_event_size=MAX_HEAD,
        ssl_certfile=None if tls is None else tls.chain,
        ssl_keyfile=None if tls is None else tls.key,
    )
    server = _Server(config)
    serving = asyncio.get_running_loop().create_task(server.serve([listener]), name="http")
    try:
        settled = asyncio.get_running_loop().create_task(server.settled.wait())
        await asyncio.wait((serving, settled), return_when=asyncio.FIRST_COMPLETED)
        settled.cancel()
        if not server.started:
            await serving
            raise RuntimeError("the console did not start")
        yield
    finally:
        server.should_exit = True
        await serving


async def wait_for_signal() -> None:
    """Until SIGINT or SIGTERM."""
    loop, asked = asyncio.get_running_loop(), asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, asked.set)
    try:
        await asked.wait()
    finally:
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.remove_signal_handler(number)
