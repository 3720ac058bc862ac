"""Accepts TLS connections: only a bounded number of handshakes goes on at a time, the newest ones."""

import asyncio
import contextlib
import socket
import ssl
from collections.abc import Callable

__all__ = ["TlsAcceptor"]

HANDSHAKE_TIMEOUT = 2.0  # s
PAUSE = 0.1  # s, when the system has no descriptor left


class TlsAcceptor:
    """Takes over a listening socket. `close` ends it and what is still shaking hands."""

    def __init__(
        self,
        listener: socket.socket,
        context: ssl.SSLContext,
        factory: Callable[[], asyncio.Protocol],
        failed: Callable[[], None],
        *,
        max_handshakes: int,
    ) -> None:
        self._listener = listener
        self._context = context
        self._factory = factory
        self._failed = failed
        self._max_handshakes = max_handshakes
        self._handshakes: dict[asyncio.Task[None], None] = {}  # oldest first
        self._accepting: asyncio.Task[None] | None = None

    def start(self) -> None:
        self._listener.setblocking(False)
        self._accepting = asyncio.get_running_loop().create_task(self._accept(), name="tls acceptor")

    async def close(self) -> None:
        """May be called again."""
        if self._accepting is not None:
            self._accepting.cancel()
            await asyncio.wait([self._accepting])
            self._accepting = None
        self._listener.close()

    async def _accept(self) -> None:
        loop = asyncio.get_running_loop()
        async with asyncio.TaskGroup() as tasks:
            while True:
                try:
                    connection, _ = await loop.sock_accept(self._listener)
                except OSError:
                    await asyncio.sleep(PAUSE)
                    continue
                if len(self._handshakes) >= self._max_handshakes:
                    next(iter(self._handshakes)).cancel()
                task = tasks.create_task(self._shake_hands(connection))
                self._handshakes[task] = None
                task.add_done_callback(lambda done: self._handshakes.pop(done, None))

    async def _shake_hands(self, connection: socket.socket) -> None:
        loop = asyncio.get_running_loop()
        try:
            connection.setblocking(False)
            await loop.connect_accepted_socket(
                self._factory, connection, ssl=self._context, ssl_handshake_timeout=HANDSHAKE_TIMEOUT
            )
        except OSError:  # ssl.SSLError and TimeoutError among them
            self._failed()
            with contextlib.suppress(OSError):
                connection.close()
        except asyncio.CancelledError:
            self._failed()
            with contextlib.suppress(OSError):
                connection.close()
            raise
