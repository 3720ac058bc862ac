"""HTTP connections with bounds: how many there may be, and how long a request's head may take.

uvicorn bounds the size of a head and the time between two requests, but waits for ever for the rest of a head that has
begun, and takes any number of connections.
"""

import asyncio
from collections import Counter
from collections.abc import Callable

import h11
from starlette.applications import Starlette
from uvicorn.protocols.http.h11_impl import H11Protocol

from server.limit_settings import LimitSettings

__all__ = ["ConnectionBounds", "guarded_by", "guarded_http"]


class ConnectionBounds:
    """How many connections there are, in all and from each address. `on_refused` gets a stable name to count."""

    def __init__(self, total: int, per_address: int, on_refused: Callable[[str], None]) -> None:
        self.on_refused = on_refused
        self._total = total
        self._per_address = per_address
        self._open: Counter[str] = Counter()

    def __len__(self) -> int:
        return self._open.total()

    def enter(self, address: str) -> bool:
        if len(self) >= self._total or self._open[address] >= self._per_address:
            self.on_refused("too_many_connections")
            return False
        self._open[address] += 1
        return True

    def leave(self, address: str) -> None:
        self._open[address] -= 1
        if self._open[address] <= 0:
            del self._open[address]


def guarded_http(bounds: ConnectionBounds, head_seconds: float) -> type[H11Protocol]:
    """uvicorn's protocol within `bounds`."""

    class GuardedHttp(H11Protocol):
        _address: str | None = None  # while it is counted
        _head_timer: asyncio.TimerHandle | None = None

        def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
            super().connection_made(transport)
            address = self.client[0] if self.client else ""
            if not bounds.enter(address):
                transport.abort()
                return
            self._address = address
            self._expect_head()

        def data_received(self, data: bytes) -> None:
            if self.conn.their_state is h11.IDLE and self._head_timer is None:
                self._expect_head()
            super().data_received(data)
            if self.conn.their_state is not h11.IDLE:
                self._head_came()

        def connection_lost(self, exc: Exception | None) -> None:
            self._leave()
            super().connection_lost(exc)

        def handle_websocket_upgrade(self, event: h11.Request) -> None:
            self._leave()  # from here on another protocol has the connection; viewers are bounded by themselves
            super().handle_websocket_upgrade(event)

        def on_response_complete(self) -> None:
            self._head_came()  # between two requests uvicorn's own timer runs
            super().on_response_complete()

        def _expect_head(self) -> None:
            self._head_timer = self.loop.call_later(head_seconds, self._too_slow)

        def _head_came(self) -> None:
            if self._head_timer is not None:
                self._head_timer.cancel()
                self._head_timer = None

        def _too_slow(self) -> None:
            self._head_timer = None
            bounds.on_refused("too_slow")
            self.transport.abort()

        def _leave(self) -> None:
            self._head_came()
            if self._address is not None:
                bounds.leave(self._address)
                self._address = None

    return GuardedHttp


def guarded_by(settings: LimitSettings, app: Starlette) -> type[H11Protocol]:
    """The protocol with the settings' bounds; refusals are counted in the app's metrics."""

    def refused(name: str) -> None:
        app.state.house.metrics.bad_input.labels("http", name).inc()

    bounds = ConnectionBounds(settings.max_connections, settings.max_address_connections, refused)
    return guarded_http(bounds, settings.request_timeout)
