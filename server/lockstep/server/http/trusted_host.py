"""Trusted-host middleware: checks each request's host name and its address's rate before anything else."""

import ipaddress
import socket
import time
from collections.abc import Callable
from urllib.parse import urlsplit

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from lockstep.server.errors import ConsoleError, HostRefused, InternalFault, TooManyRequests, http_error
from lockstep.server.http.problem import problem_response
from lockstep.server.http.robot_paths import below_robot
from lockstep.server.http.transport.client_address import counted_address
from lockstep.server.http.transport.connection_places import ConnectionPlaces, Place
from lockstep.server.http.transport.uvicorn_http_limits import PLACE
from lockstep.server.util.fair_queue import FairQueue
from lockstep.server.util.rate_limits import RateLimits

__all__ = ["STOP_BURST", "STOP_RATE", "TrustedHost", "HostNames", "client_address"]

STOPS = ("/api/stop", "/api/fleet/stop")
# Stops of one link by HTTP that pass every limit and wait for nobody. A page repeats a press once a second, to each
# console; further stops go through the limits and turns of all other requests.
STOP_RATE, STOP_BURST = 20.0, 20  # Hz
HEALTH = ("/healthz", "/readyz")  # counted apart: a check must not fail because of other requests from its address
POLICY_VIOLATION = 1008  # RFC 6455 7.4.1
PATIENCE = 5  # requests in a row that are turned away, then the connection is closed
CLOSE = (b"connection", b"close")


class HostNames:
    """The host names that a request may be for.

    Another site can have its name point to the console's address (DNS rebinding); its page then counts as the same
    site. Its requests still carry that name. An address cannot be made to point elsewhere, so all addresses pass.
    """

    def __init__(self, names: tuple[str, ...], machine: str = "") -> None:
        machine = machine or socket.gethostname().lower()
        self._any = "*" in names
        self._names = {name.lower() for name in names} | {"localhost", machine, f"{machine}.local"}

    def check(self, host: str | None) -> None:
        """Raise HostRefused if `host` is not one of the names."""
        if self._any:
            return
        try:
            name = urlsplit(f"//{host or ''}").hostname or ""
        except ValueError as error:
            raise HostRefused("the Host header is not valid") from error
        if name not in self._names and not name.endswith(".localhost") and not _is_address(name):
            raise HostRefused(
                "the Host header names a host that this console does not serve; LOCKSTEP_ALLOWED_HOSTS adds hosts"
            )


class TrustedHost:
    """An ASGI middleware, for HTTP and WebSockets. Refusals are counted by name and answered like all others.

    A request with a good token is served before those without, and keeps its connection when there are too many; a
    stop with one passes every limit, up to a rate per link, unless the link's stops are silenced. A fault of the app is
    answered by name, counted, and goes no further.
    """

    def __init__(
        self,
        app: ASGIApp,
        hosts: HostNames,
        requests: RateLimits,
        count: Callable[[Scope, str], None],
        clock: Callable[[], float] = time.monotonic,
        *,
        health: RateLimits | None = None,
        link_of: Callable[[Scope], str] = lambda scope: "",
        is_silenced: Callable[[Scope, str], bool] = lambda scope, link: False,
        places: ConnectionPlaces | None = None,
        caught: Callable[[Scope, Exception], None] | None = None,
    ) -> None:
        """`health`: limits of health checks. `link_of`: returns the link of a request's good token, "" without one.

        `is_silenced`: whether a supervisor has silenced the stops of that link.
        """
        self._app = app
        self._hosts = hosts
        self._requests = requests
        self._health = requests if health is None else health
        self._count = count
        self._clock = clock
        self._stops = RateLimits(STOP_RATE, STOP_BURST)  # by link
        self._link_of = link_of
        self._is_silenced = is_silenced
        self._places = places
        self._caught = caught
        self._turns = FairQueue()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        address, link = client_address(scope), self._link_of(scope)
        place = scope.get("state", {}).get(PLACE)
        if isinstance(place, Place) and self._places is not None:
            if not self._places.serve(place, address, link):
                return  # others needed its place
            send = _patient(send, place)
        try:
            self._hosts.check(Headers(scope=scope).get("host"))
            goes_first = self._goes_first(scope, link)
            if not goes_first:
                self._check_rate(scope, address)
        except ConsoleError as error:
            self._count(scope, http_error(error).name)
            await _refuse(scope, send, error)
            return
        if not goes_first:
            await self._turns.take(link or address, first=bool(link))
        await self._serve(scope, receive, send)

    def _goes_first(self, scope: Scope, link: str) -> bool:
        """True if it is a stop that passes every limit."""
        if not link or scope.get("method") != "POST" or not _is_one_of(scope, STOPS):
            return False
        return not self._is_silenced(scope, link) and self._stops.spend(link, self._clock())

    def _check_rate(self, scope: Scope, address: str) -> None:
        limits = self._health if _is_one_of(scope, HEALTH) else self._requests
        if not limits.spend(address, self._clock()):
            raise TooManyRequests("too many requests from this address")

    async def _serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        started = False

        async def watched(message: Message) -> None:
            nonlocal started
            started = True
            await send(message)

        try:
            await self._app(scope, receive, watched)
        except Exception as error:
            if self._caught is None:
                raise
            self._caught(scope, error)
            if not started:
                await _refuse(scope, send, InternalFault("the console could not answer; its log says why"))


def _is_one_of(scope: Scope, paths: tuple[str, ...]) -> bool:
    return below_robot(scope["path"]) in paths


def _patient(send: Send, place: Place) -> Send:
    """Close the connection after `PATIENCE` refused requests in a row. A good token in between resets the count."""

    async def counted(message: Message) -> None:
        if message["type"] == "http.response.start":
            refused = 400 <= message["status"] < 500 and (not place.link or message["status"] == 429)
            place.refused = place.refused + 1 if refused else 0
            if place.refused >= PATIENCE:
                message = {**message, "headers": [*message.get("headers", []), CLOSE]}
        await send(message)

    return counted


def client_address(scope: Scope) -> str:
    """Return a client's address as it is counted."""
    client = scope.get("client")
    return "" if client is None else counted_address(str(client[0]))


async def _refuse(scope: Scope, send: Send, error: ConsoleError) -> None:
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": POLICY_VIOLATION})
        return
    entry = http_error(error)
    answer = problem_response(entry.status, entry.name, error.detail, entry.headers)
    await send({"type": "http.response.start", "status": answer.status_code, "headers": answer.raw_headers})
    await send({"type": "http.response.body", "body": answer.body})


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
