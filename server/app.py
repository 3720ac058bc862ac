"""The console's app for one robot, put together in one place: routes, middleware, error map, lifespan."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import msgspec
from fastapi import Depends, FastAPI, Response
from starlette.middleware.cors import CORSMiddleware
from starlette.requests import HTTPConnection
from starlette.types import Lifespan

from server import api, api_access, api_ice, api_recordings, api_relay, scene_proxy, whep
from server.error_answers import answer_errors, count_refused
from server.front_door import FrontDoor, HostNames
from server.guard import Guard
from server.house import House
from server.log_context import LogContext
from server.media.aiortc_private import own_addresses, restrict_ice_hosts
from server.metrics import Metrics
from server.openapi import openapi_document
from server.page import page_router
from server.rate_limits import RateLimits
from server.robot_session import running_session
from server.security import SAFE_METHODS, SecurityHeaders, check_origin
from server.services import Services
from server.settings import Settings
from server.state import ConsoleState, open_state
from server.sweeper import sweep_forever

__all__ = ["attach_session", "create_app", "guard_app", "restrict_ice", "same_origin", "session_app"]

LOOPBACK = "127.0.0.1"


def create_app(settings: Settings, state: ConsoleState | None = None) -> FastAPI:
    """The app. It connects to the robot while its lifespan runs; `state` stands in for what the settings name."""

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        opened = state or open_state(settings)
        restrict_ice(settings)
        metrics = Metrics()
        house = House(opened, Guard(settings), metrics)
        app.state.house = house
        async with running_session(settings, house, metrics, opened.directory) as made:
            attach_session(app, made)
            peers, clock = made.console.peers, made.console.clock
            async with asyncio.TaskGroup() as tasks:
                running = [
                    tasks.create_task(house.run(), name="links"),
                    tasks.create_task(sweep_forever(lambda: peers.ended, lambda: clock.moving), name="sweeper"),
                ]
                yield
                for task in running:
                    task.cancel()

    app = session_app(settings, lifespan)
    app.add_api_route("/openapi.json", _describe, include_in_schema=False)
    app.include_router(page_router())
    guard_app(app, settings)
    return app


def session_app(settings: Settings, lifespan: Lifespan[FastAPI] | None = None) -> FastAPI:
    """The routes of one robot but for its pages. They need `app.state.house`, and answer by `attach_session`."""
    app = FastAPI(
        title="Lockstep",
        lifespan=lifespan,
        dependencies=[Depends(same_origin)],
        docs_url=None,
        redoc_url=None,
        openapi_url=None,
    )
    app.state.settings = settings
    app.include_router(whep.router)
    app.include_router(api.router)
    app.include_router(api_access.router)
    app.include_router(api_ice.router)
    app.include_router(api_recordings.router)
    app.include_router(api_relay.router)
    app.include_router(scene_proxy.router)
    answer_errors(app)
    app.add_middleware(LogContext)
    return app


def attach_session(app: FastAPI, session: Services | None) -> None:
    """From now on the routes speak for that session; None: it has failed, and they say so."""
    app.state.services = session
    app.state.recordings = None if session is None else session.recordings


def guard_app(app: FastAPI, settings: Settings) -> None:
    """What every request passes before any route."""
    if settings.allowed_origins:
        app.add_middleware(
            CORSMiddleware,
            allow_origins=list(settings.allowed_origins),
            allow_methods=["GET", "POST", "PATCH", "DELETE"],
            allow_headers=["Authorization", "Content-Type", "If-Match"],
            expose_headers=["Location", "ETag", "Link"],
        )
    app.add_middleware(
        FrontDoor,
        hosts=HostNames((settings.host, *settings.own_names)),
        requests=RateLimits(settings.max_request_rate, settings.max_request_burst),
        count=count_refused,
    )
    app.add_middleware(SecurityHeaders, lasting_tls=settings.tls_cert is not None, relays=settings.relay_origins)


def restrict_ice(settings: Settings) -> None:
    """A console bound to loopback offers loopback, which aioice never gathers, and this machine's own addresses.

    Firefox pairs loopback with nothing unless a hidden preference says so; it reaches the console by an own address.
    Only who got ICE credentials over the loopback-bound signalling can use either.
    """
    if settings.ice_hosts:
        restrict_ice_hosts(settings.ice_hosts)
    elif settings.bound_to_loopback:
        restrict_ice_hosts([settings.host if settings.host != "localhost" else LOOPBACK, *own_addresses()])


def same_origin(connection: HTTPConnection) -> None:
    """A dependency of all routes. WebSockets check for themselves: a refusal is another thing there."""
    if connection.scope["type"] == "http" and connection.scope["method"] not in SAFE_METHODS:
        check_origin(connection.headers, connection.app.state.settings.allowed_origins)


async def _describe() -> Response:
    return Response(msgspec.json.encode(openapi_document()), media_type="application/json")
