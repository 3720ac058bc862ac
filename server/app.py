"""The console's app, put together in one place: routes, middleware, error map, lifespan."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import msgspec
import structlog
from fastapi import Depends, FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.middleware.cors import CORSMiddleware
from starlette.requests import HTTPConnection
from starlette.types import Scope

from server import api, api_access, api_ice, api_recordings, api_relay, scene_proxy, whep
from server.api_recordings import RecordingService
from server.audit_log import AuditLog, open_audit_log
from server.console import Console
from server.errors import AccessError, ConsoleError, TooManyRequests, http_error
from server.event_clock import EventClock
from server.front_door import FrontDoor, HostNames
from server.guard import Guard
from server.link_warden import LinkWarden
from server.log_context import LogContext, follow_clock
from server.media.aiortc_private import own_addresses, restrict_ice_hosts
from server.media.plane import MediaPlane
from server.media.sources.desk import SourceDesk
from server.metrics import Metrics
from server.openapi import openapi_document
from server.page import page_router
from server.rate_limits import RateLimits
from server.recording.library import ConsoleLibrary
from server.recording.recorder import Recorder, recordings_directory
from server.recording.shelf import Shelf
from server.relay.desk import RelayDesk, RelayedMedia
from server.scene import SceneView
from server.security import SAFE_METHODS, SecurityHeaders, check_origin
from server.services import Services, services
from server.settings import Settings
from server.state import ConsoleState, open_state
from server.sweeper import sweep_forever
from server.voice import VoiceService

__all__ = ["create_app"]

log = structlog.get_logger(__name__)

LOOPBACK = "127.0.0.1"


def create_app(settings: Settings, state: ConsoleState | None = None) -> FastAPI:
    """The app. It connects to the robot while its lifespan runs; `state` stands in for what the settings name."""

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        opened = state or open_state(settings)
        with open_audit_log(opened.directory, settings) as audit:
            async with _console(app, opened, audit):
                yield

    @asynccontextmanager
    async def _console(app: FastAPI, opened: ConsoleState, audit: AuditLog) -> AsyncIterator[None]:
        _restrict_ice(settings)
        metrics = Metrics()
        media = MediaPlane(settings.media, metrics.registry, settings.sources)
        scene = await _start_scene(settings, metrics)
        clock = EventClock()
        shelf = Shelf(recordings_directory(settings.recording, opened.directory.path), settings.recording)
        recorder = Recorder(settings.recording, shelf, clock, media, lambda news: console.peers.tell("session", news))
        relays = RelayDesk(settings, media, lambda: console.peers, opened.signing_key(settings))
        console = Console(settings, metrics, RelayedMedia(media, relays), scene, audit, clock, recorder)
        console.peers.relays.append(relays)
        console.further_news.append(recorder.state)
        app.state.recordings = RecordingService(ConsoleLibrary(recorder), opened.access)
        sources = SourceDesk(
            settings.sources, console.clock, media, metrics.registry, lambda news: console.peers.tell("session", news)
        )
        if sources.sources:
            console.further_news.append(sources.state)
        voice = VoiceService(
            settings.speaker_spec,
            console.seat.rules.holds,
            metrics.registry,
            lambda news: console.peers.tell("session", news),
        )
        if voice.enabled:
            console.further_news.append(voice.state)
        follow_clock(console.clock)
        audit.on_trouble = lambda trouble: console.audit_trouble(trouble, audit.lost)
        warden = LinkWarden(opened.invitations, console.peers, console.audit, metrics)
        guard = Guard(settings)
        app.state.services = Services(
            settings, metrics, console, media, opened, audit, warden, guard, scene, relays, voice
        )
        try:
            async with asyncio.TaskGroup() as tasks:
                running = [
                    tasks.create_task(console.run(), name="console"),
                    tasks.create_task(warden.run(), name="links"),
                    tasks.create_task(sources.run(), name="sources"),
                    tasks.create_task(voice.run(), name="voice"),
                    tasks.create_task(recorder.run(), name="recorder"),
                    tasks.create_task(relays.run(), name="relays"),
                    tasks.create_task(
                        sweep_forever(lambda: console.peers.ended, lambda: console.clock.moving), name="sweeper"
                    ),
                ]
                if scene is not None:
                    running.append(tasks.create_task(scene.run(), name="scene"))
                yield
                for task in running:
                    task.cancel()
        finally:
            await media.close()
            if scene is not None:
                await scene.close()

    app = FastAPI(
        title="Lockstep",
        lifespan=lifespan,
        dependencies=[Depends(_same_origin)],
        docs_url=None,
        redoc_url=None,
        openapi_url=None,
    )
    app.include_router(whep.router)
    app.include_router(api.router)
    app.include_router(api_access.router)
    app.include_router(api_ice.router)
    app.include_router(api_recordings.router)
    app.include_router(api_relay.router)
    app.add_api_route("/openapi.json", _describe, include_in_schema=False)
    app.include_router(scene_proxy.router)
    app.include_router(page_router())
    app.add_exception_handler(ConsoleError, _answer_console_error)
    app.add_exception_handler(HTTPException, _answer_http_exception)
    app.add_exception_handler(RequestValidationError, _answer_validation_error)
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
        count=_count_refused,
    )
    app.add_middleware(LogContext)
    app.add_middleware(SecurityHeaders, lasting_tls=settings.tls_cert is not None, relays=settings.relay_origins)
    return app


def _restrict_ice(settings: Settings) -> None:
    """A console bound to loopback offers loopback, which aioice never gathers, and this machine's own addresses.

    Firefox pairs loopback with nothing unless a hidden preference says so; it reaches the console by an own address.
    Only who got ICE credentials over the loopback-bound signalling can use either.
    """
    if settings.ice_hosts:
        restrict_ice_hosts(settings.ice_hosts)
    elif settings.bound_to_loopback:
        restrict_ice_hosts([settings.host if settings.host != "localhost" else LOOPBACK, *own_addresses()])


async def _start_scene(settings: Settings, metrics: Metrics) -> SceneView | None:
    if not settings.scene:
        return None
    scene = SceneView(settings.scene_hz, settings.max_scene_viewers, metrics)
    await scene.start()
    return scene


def _same_origin(connection: HTTPConnection) -> None:
    """WebSockets check for themselves: a refusal is another thing there."""
    if connection.scope["type"] == "http" and connection.scope["method"] not in SAFE_METHODS:
        check_origin(connection.headers, services(connection).settings.allowed_origins)


async def _answer_console_error(request: Request, error: Exception) -> Response:
    if not isinstance(error, ConsoleError):
        raise error
    return _answer(request, error)


def _answer(request: Request, error: ConsoleError) -> Response:
    if isinstance(error, AccessError) and not services(request).guard.may_fail(request.scope):
        error = TooManyRequests("too many requests without a valid token from this address")
    entry = http_error(error)
    services(request).metrics.bad_input.labels("http", entry.name).inc()
    return _error_response(entry.status, entry.name, error.detail, entry.headers)


async def _describe() -> Response:
    return Response(msgspec.json.encode(openapi_document()), media_type="application/json")


def _count_refused(scope: Scope, name: str) -> None:
    """What the front door turned away."""
    scope["app"].state.services.metrics.bad_input.labels("http", name).inc()


async def _answer_http_exception(request: Request, error: Exception) -> Response:
    """Routes that do not exist, methods that are not allowed."""
    if not isinstance(error, HTTPException):
        raise error
    name = {404: "not_found", 405: "method_not_allowed"}.get(error.status_code, "http_error")
    services(request).metrics.bad_input.labels("http", name).inc()
    return _error_response(error.status_code, name, error.detail, dict(error.headers or {}))


async def _answer_validation_error(request: Request, error: Exception) -> Response:
    services(request).metrics.bad_input.labels("http", "bad_parameter").inc()
    return _error_response(422, "bad_parameter", "a parameter has a value that is not allowed", {})


def _error_response(status: int, name: str, detail: str, headers: dict[str, str]) -> Response:
    body = msgspec.json.encode({"error": name, "detail": detail})
    return Response(body, status, {**headers, "Cache-Control": "no-store"}, media_type="application/json")
