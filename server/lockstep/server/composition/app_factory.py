"""The common parts of a console's apps, for one robot or several: context, error answers, middleware."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import structlog
from fastapi import Depends, FastAPI
from starlette.datastructures import Headers
from starlette.middleware.cors import CORSMiddleware
from starlette.requests import HTTPConnection
from starlette.types import Lifespan, Scope

from lockstep.server.auth.known_tokens import KnownTokens
from lockstep.server.auth.tokens import bearer_token
from lockstep.server.errors import AccessError
from lockstep.server.http.request_rate_limits import RequestRateLimits
from lockstep.server.http.security_headers import SAFE_METHODS, SecurityHeaders, check_origin
from lockstep.server.http.transport.connection_places import ConnectionPlaces
from lockstep.server.http.trusted_host import HostNames, TrustedHost
from lockstep.server.routes.error_responses import answer_errors, count_refused
from lockstep.server.settings import Settings
from lockstep.server.state.console_context import ConsoleContext, ContextMetrics
from lockstep.server.state.persistent_state import ConsoleState, open_state
from lockstep.server.util.rate_limits import RateLimits
from lockstep.server.webrtc.media_endpoint import MediaEndpoint

__all__ = ["bare_app", "add_middleware", "open_context"]

log = structlog.get_logger(__name__)


def bare_app(title: str, settings: Settings, lifespan: Lifespan[FastAPI] | None = None) -> FastAPI:
    """Return an app without routes. It needs `app.state.context` before the first request.

    `app.state.failed` is set when its lifespan has failed: then it serves nobody any more.
    """
    app = FastAPI(
        title=title,
        lifespan=None if lifespan is None else _noticed(lifespan),
        dependencies=[Depends(_same_origin)],
        docs_url=None,
        redoc_url=None,
        openapi_url=None,
    )
    app.state.settings = settings
    answer_errors(app)
    return app


def _noticed(lifespan: Lifespan[FastAPI]) -> Lifespan[FastAPI]:
    @asynccontextmanager
    async def noticed(app: FastAPI) -> AsyncIterator[None]:
        app.state.failed = asyncio.Event()
        try:
            async with lifespan(app):
                yield
        except BaseException:
            app.state.failed.set()
            raise

    return noticed


def open_context(
    app: FastAPI,
    settings: Settings,
    state: ConsoleState | None,
    metrics: ContextMetrics,
    max_peers: int | None = None,
    reserved: int = 0,
) -> ConsoleContext:
    """Open the context when the lifespan of `app` begins; `state` replaces the one that the settings name."""
    asyncio.get_running_loop().set_exception_handler(metrics.faults.uncaught)
    opened = state or open_state(settings)
    endpoint = MediaEndpoint(settings)
    if settings.media_port:  # another process might take it meanwhile
        endpoint.open()
    context = ConsoleContext(opened, RequestRateLimits(settings), metrics, endpoint, max_peers, reserved)
    app.state.context = context
    log.info("audit and recordings are signed", public_key=opened.signer.public_key)
    return context


def add_middleware(app: FastAPI, settings: Settings) -> None:
    """Add the middleware that every request passes before any route."""
    if settings.allowed_origins:
        app.add_middleware(
            CORSMiddleware,
            allow_origins=list(settings.allowed_origins),
            allow_methods=["GET", "POST", "PATCH", "DELETE"],
            allow_headers=["Authorization", "Content-Type", "If-Match"],
            expose_headers=["Location", "ETag", "Link"],
        )
    places = ConnectionPlaces.within(settings, lambda name: count_refused({"app": app}, name))
    known = KnownTokens()
    app.state.connection_places, app.state.known_tokens = places, known
    app.add_middleware(
        TrustedHost,
        hosts=HostNames((settings.host, *settings.own_names)),
        requests=RateLimits(settings.max_request_rate, settings.max_request_burst),
        health=RateLimits(settings.max_request_rate, settings.max_request_burst),
        count=count_refused,
        link_of=lambda scope: _link_of(scope, known),
        is_silenced=_is_silenced,
        places=places,
        caught=_caught,
    )
    app.add_middleware(
        SecurityHeaders,
        lasting_tls=settings.tls_cert is not None,
        relays=settings.relay_origins,
        hid=settings.force_feedback,
    )


def _link_of(scope: Scope, known: KnownTokens) -> str:
    """Return the link of a request's good token; "" without one. Each route decides what it opens."""
    token = bearer_token(Headers(scope=scope).get("authorization"))
    context = getattr(scope["app"].state, "context", None)
    if not token or not isinstance(context, ConsoleContext):
        return ""
    try:
        # Enough for a STOP, so it is good also while the revoked links are unknown.
        link = context.state.access.at(None).bearer_to_stop(f"Bearer {token}").token_id
    except AccessError:
        known.forget(token)
        return ""
    known.add(token)
    return link


def _is_silenced(scope: Scope, link: str) -> bool:
    context = getattr(scope["app"].state, "context", None)
    return isinstance(context, ConsoleContext) and context.is_silenced(link)


def _caught(scope: Scope, error: Exception) -> None:
    context = scope["app"].state.context
    if isinstance(context, ConsoleContext):
        context.metrics.faults.caught("http", error, method=scope.get("method", ""), route=_route(scope))


def _route(scope: Scope) -> str:
    """Return the route, not the path: a path may hold a ticket."""
    return str(getattr(scope.get("route"), "path", ""))


async def _same_origin(connection: HTTPConnection) -> None:
    """Check the origin, for all routes. WebSockets check it themselves: they refuse in another way."""
    if connection.scope["type"] == "http" and connection.scope["method"] not in SAFE_METHODS:
        check_origin(connection.headers, connection.app.state.settings.allowed_origins)
