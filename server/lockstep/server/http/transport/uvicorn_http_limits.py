"""Bounds on HTTP connections: their input is handled in turns, and one deadline holds for a whole exchange.

uvicorn bounds the size of a head and the time between two requests. It waits forever for the rest of a request that
has begun and for a client that does not read its answer, and handles all input at once.
"""

import asyncio
import re
from typing import NamedTuple

import h11
from starlette.applications import Starlette
from uvicorn.protocols.http.h11_impl import H11Protocol

from lockstep.rtc.token_bucket import TokenBucket
from lockstep.server.auth.known_tokens import KnownTokens
from lockstep.server.http.limit_settings import LimitSettings
from lockstep.server.http.transport.acceptor import PlacedProtocol
from lockstep.server.http.transport.connection_places import ConnectionPlaces, Place
from lockstep.server.util.fair_queue import FairQueue
from lockstep.server.util.rate_limits import RateLimits

__all__ = ["DEADLINE", "MAX_HEAD", "PLACE", "BoundedConnections", "bounded_by", "bounded_http"]

DEADLINE, PLACE = "request_deadline", "place"  # keys of a request's `state`
GRACE = 1.0  # s after the deadline, in which the answer that reports it may leave
LEAST_READ = 16 * 1024  # bytes of an answer that a client reads within the time of a request
MAX_HEAD = 16 * 1024  # bytes of a request's head
LINK_RATE, LINK_BURST = 50.0, 300  # Hz, of one link's input that goes first; a page's load takes some 30
STOP_RATE, STOP_BURST = 50.0, 100  # the same for its stops, counted apart
STOP = re.compile(rb"POST [!-~]{0,500}/api/(?:fleet/)?stop[ ?]")
BEARER = re.compile(rb"\r\nauthorization:[ \t]*bearer[ \t]+([!-~]{1,4096})[ \t]*\r\n", re.IGNORECASE)


class BoundedConnections(NamedTuple):
    """The parts that `lockstep.server.http.transport.serve.running` needs to bound connections."""

    protocol: type[PlacedProtocol]
    places: ConnectionPlaces
    turns: FairQueue


def bounded_http(
    places: ConnectionPlaces, turns: FairQueue, tokens: KnownTokens, seconds: float
) -> type[PlacedProtocol]:
    """Return uvicorn's protocol with bounds. `seconds`: for a whole request, and for each part of its answer."""
    budgets = {True: RateLimits(STOP_RATE, STOP_BURST), False: RateLimits(LINK_RATE, LINK_BURST)}  # by: is it a stop

    class BoundedHttp(H11Protocol, PlacedProtocol):
        place: Place
        _timer: asyncio.TimerHandle | None = None
        _asked = False  # for a turn
        _in_turn = False
        _read = True  # whether the client has read something of its answer since the last look
        _unread = 0  # bytes, at the last look
        _upgraded = False
        _awaited = True  # a whole request, or the rest of one
        _is_stop = False  # the request that is coming

        def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
            super().connection_made(transport)
            self._arrived = bytearray()
            self.app_state = {**self.app_state, PLACE: self.place}
            self.place.close = transport.abort
            if self.place.group is None:  # it was taken away in the handshake
                transport.abort()
                return
            self._begin()

        def data_received(self, data: bytes) -> None:
            self._arrived += data
            self._ask()

        def handle_events(self) -> None:
            """Handle what has come. Requests behind the one that was answered had come with it: each has a turn too."""
            behind, _ = self.conn.trailing_data
            if self._in_turn or self.conn.their_state is not h11.IDLE or not behind:
                super().handle_events()
            else:
                self._ask()

        def _ask(self) -> None:
            """Have what has come handled in its turn."""
            self.transport.pause_reading()
            if not self._asked:
                self._asked = True
                known = self._known()
                first = bool(known) and budgets[self._is_stop].spend(known, self.loop.time())
                turns.ask(known or self.place.address, self._take, first=first)

        def _known(self) -> str:
            """Return the good token, or the link, of what has come; "" if it is a stranger's."""
            if self.conn.their_state is not h11.IDLE:
                return self.place.link
            behind, _ = self.conn.trailing_data
            head = behind[:MAX_HEAD] + self._arrived[: max(0, MAX_HEAD - len(behind))]
            self._is_stop = STOP.match(head) is not None
            found = BEARER.search(head)
            token = "" if found is None else found[1].decode("ascii")
            return token if token in tokens else ""

        def _take(self) -> None:
            """Handle what has come so far; called in its turn."""
            self._asked = False
            if self.transport.is_closing():
                return
            data, self._arrived = bytes(self._arrived), bytearray()
            if not self._awaited and self.conn.their_state is h11.IDLE:
                self._begin()
            self._in_turn = True
            try:
                if data:
                    super().data_received(data)
                else:  # which would be the end, to h11
                    super().handle_events()
            except BaseException:
                self.transport.abort()
                raise
            finally:
                self._in_turn = False
            if self._upgraded or not self.flow.read_paused:
                self.transport.resume_reading()

        def send_400_response(self, msg: str) -> None:
            places.on_refused("bad_request")
            if self.cycle is not None and not self.cycle.response_complete:
                self.cycle.disconnected = True  # the app's answer is discarded; a stop has effect all the same
                self.cycle.message_event.set()
            if self.conn.our_state in (h11.IDLE, h11.SEND_RESPONSE):
                super().send_400_response(msg)
            else:  # it has been answered already
                self.transport.abort()

        def resume_writing(self) -> None:
            self._read = True
            super().resume_writing()

        def connection_lost(self, exc: Exception | None) -> None:
            self._leave()
            super().connection_lost(exc)

        def handle_websocket_upgrade(self, event: h11.Request) -> None:
            self._leave()  # another protocol takes over the connection; viewers have other bounds
            self._upgraded = True
            self.app_state = {key: value for key, value in self.app_state.items() if key != PLACE}
            super().handle_websocket_upgrade(event)

        def on_response_complete(self) -> None:
            super().on_response_complete()
            self._awaited = self.conn.their_state is h11.SEND_BODY  # else uvicorn's own timer runs, until the next one
            if self._awaited and self.loop.time() >= self.app_state[DEADLINE]:
                self.transport.close()  # answered without the rest of the body, which was reported or counted

        def _begin(self) -> None:
            """Begin an exchange, at its first byte or with the connection."""
            self._awaited = True
            self.app_state[DEADLINE] = self.loop.time() + seconds
            if self._timer is not None:
                self._timer.cancel()
            self._timer = self.loop.call_later(seconds, self._look)

        def _look(self) -> None:
            self._timer, after = None, seconds
            now, unread = self.loop.time(), self.transport.get_write_buffer_size()
            if self.conn.their_state is h11.SEND_BODY and now < self.app_state[DEADLINE] + GRACE:
                after = GRACE  # the reader of the body reports by name that it did not come
            elif self._awaited and self.conn.their_state in (h11.IDLE, h11.SEND_BODY):
                self._end("too_slow")
                return
            elif unread and not self._read and unread > self._unread - LEAST_READ:
                self._end("does_not_read")
                return
            else:
                self._read, self._unread = False, unread
            self._timer = self.loop.call_later(after, self._look)

        def _end(self, why: str) -> None:
            places.on_refused(why)
            self.transport.abort()

        def _leave(self) -> None:
            if self._timer is not None:
                self._timer.cancel()
                self._timer = None
            places.leave(self.place)

    return BoundedHttp


def bounded_by(settings: LimitSettings, app: Starlette) -> BoundedConnections:
    """Return connections within the settings' bounds, to an app that `add_middleware` has prepared."""
    places: ConnectionPlaces = app.state.connection_places
    turns = FairQueue(TokenBucket(settings.max_stranger_rate, settings.max_stranger_burst))
    protocol = bounded_http(places, turns, app.state.known_tokens, settings.request_timeout)
    return BoundedConnections(protocol, places, turns)
