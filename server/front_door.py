"""What every request passes before anything looks at it: whose name it asks for, and how often its address asks."""

import ipaddress
import socket
import time
from collections.abc import Callable
from urllib.parse import urlsplit

import msgspec
from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from server.errors import ConsoleError, HostRefused, TooManyRequests, http_error
from server.rate_limits import RateLimits
from server.request_turns import RequestTurns
from server.robot_paths import below_robot

__all__ = ["FrontDoor", "HostNames", "client_address"]

# A stop is never turned away and never waits; a health check must not fail for others' floods.
UNLIMITED = ("/api/stop", "/api/fleet/stop", "/healthz", "/readyz")
POLICY_VIOLATION = 1008  # RFC 6455 7.4.1


class HostNames:
    """The names that a request may be for.

    A page of another site can have its name point to our address (DNS rebinding) and then counts as the same site.
    Its requests still say whose name they are for. An address cannot be made to point elsewhere, so all addresses pass.
    """

    def __init__(self, names: tuple[str, ...], machine: str = "") -> None:
        machine = machine or socket.gethostname().lower()
        self._any = "*" in names
        self._names = {name.lower() for name in names} | {"localhost", machine, f"{machine}.local"}

    def check(self, host: str | None) -> None:
        """Raises HostRefused."""
        if self._any:
            return
        try:
            name = urlsplit(f"//{host or ''}").hostname or ""
        except ValueError as error:
            raise HostRefused("the Host header is not valid") from error
        if name not in self._names and not name.endswith(".localhost") and not _is_address(name):
            raise HostRefused("this console does not go by that name; LOCKSTEP_ALLOWED_HOSTS lists further ones")


class FrontDoor:
    """An ASGI middleware, for HTTP and WebSockets. Refusals are counted by name and answered like all others."""

    def __init__(
        self,
        app: ASGIApp,
        hosts: HostNames,
        requests: RateLimits,
        count: Callable[[Scope, str], None],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._app = app
        self._hosts = hosts
        self._requests = requests
        self._count = count
        self._clock = clock
        self._turns = RequestTurns()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        try:
            self._check(scope)
        except ConsoleError as error:
            self._count(scope, http_error(error).name)
            await _refuse(scope, send, error)
        else:
            if not _is_unlimited(scope):
                await self._turns.take(client_address(scope))
            await self._app(scope, receive, send)

    def _check(self, scope: Scope) -> None:
        self._hosts.check(Headers(scope=scope).get("host"))
        if not _is_unlimited(scope) and not self._requests.spend(client_address(scope), self._clock()):
            raise TooManyRequests("too many requests from this address")


def _is_unlimited(scope: Scope) -> bool:
    return below_robot(scope["path"]) in UNLIMITED


def client_address(scope: Scope) -> str:
    """Of one client; IPv6 clients own at least a /64, so that counts as one."""
    client = scope.get("client")
    if client is None:
        return ""
    try:
        address = ipaddress.ip_address(client[0])
    except ValueError:
        return str(client[0])
    return str(address) if address.version == 4 else str(ipaddress.ip_network((address, 64), strict=False))


async def _refuse(scope: Scope, send: Send, error: ConsoleError) -> None:
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": POLICY_VIOLATION})
        return
    entry = http_error(error)
    body = msgspec.json.encode({"error": entry.name, "detail": error.detail})
    headers = {"content-type": "application/json", "cache-control": "no-store", "content-length": str(len(body))}
    headers |= {name.lower(): value for name, value in entry.headers.items()}
    raw = [(name.encode(), value.encode()) for name, value in headers.items()]
    await send({"type": "http.response.start", "status": entry.status, "headers": raw})
    await send({"type": "http.response.body", "body": body})


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
