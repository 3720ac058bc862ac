"""The console's app for one robot, put together in one place: routes, middleware, error map, lifespan."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, closing
from functools import cache

import msgspec
from fastapi import FastAPI, Response
from starlette.types import Lifespan

from lockstep.server.composition.app_factory import add_middleware, bare_app, open_context
from lockstep.server.composition.robot_session import running_session
from lockstep.server.http.json_response import json_answer
from lockstep.server.http.static_files import page_router
from lockstep.server.routes import (
    access,
    actions,
    dial_in,
    episodes,
    maps,
    observer_websocket,
    seat,
    session,
)
from lockstep.server.routes import scene_proxy as proxy
from lockstep.server.routes.openapi import openapi_document
from lockstep.server.routes.recorded import recorded_episodes, recordings
from lockstep.server.routes.webrtc import ice, sfu, whep, whip
from lockstep.server.settings import Settings
from lockstep.server.state.dependencies import Dependencies
from lockstep.server.state.persistent_state import ConsoleState
from lockstep.server.telemetry.background import keep_running
from lockstep.server.telemetry.log_context import LogContext
from lockstep.server.telemetry.metrics import Metrics
from lockstep.server.util.process.gc_scheduler import sweep_forever

__all__ = ["attach_session", "create_app", "session_app"]


def create_app(settings: Settings, state: ConsoleState | None = None) -> FastAPI:
    """Return the app, which connects to the robot in its lifespan. `state` replaces the one that the settings name."""

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        metrics = Metrics()
        with closing(open_context(app, settings, state, metrics)) as context:
            async with running_session(settings, context, metrics, context.state.directory) as made:
                attach_session(app, made)
                peers, clock = made.console.peers, made.console.clock
                async with asyncio.TaskGroup() as tasks:
                    running = [
                        tasks.create_task(context.run(), name="links"),
                        tasks.create_task(
                            keep_running(
                                "sweeper",
                                lambda: sweep_forever(lambda: peers.ended, lambda: clock.moving),
                                metrics.faults,
                            ),
                            name="sweeper",
                        ),
                    ]
                    yield
                    for task in running:
                        task.cancel()

    app = session_app(settings, lifespan)
    app.add_api_route("/openapi.json", _describe, include_in_schema=False)
    app.include_router(page_router())
    add_middleware(app, settings)
    return app


def session_app(settings: Settings, lifespan: Lifespan[FastAPI] | None = None) -> FastAPI:
    """Return an app of one robot's routes, without pages. It needs `app.state.context` and `attach_session`."""
    app = bare_app("Lockstep", settings, lifespan)
    app.include_router(whep.router)
    app.include_router(whip.router)
    app.include_router(session.router)
    app.include_router(seat.router)
    app.include_router(actions.router)
    app.include_router(maps.router)
    app.include_router(access.router)
    app.include_router(ice.router)
    app.include_router(recordings.router)
    app.include_router(recorded_episodes.router)
    app.include_router(episodes.router)
    app.include_router(sfu.router)
    app.include_router(proxy.router)
    app.include_router(observer_websocket.router)
    app.include_router(dial_in.router)
    app.add_middleware(LogContext)
    return app


def attach_session(app: FastAPI, session: Dependencies | None) -> None:
    """Let the routes answer for that session from now on; None: it has failed, and they say so."""
    app.state.dependencies = session
    app.state.recordings = None if session is None else session.recordings


@cache
def _description() -> msgspec.Raw:
    """Return the OpenAPI document, made once: it is large, and anybody may ask for it."""
    return msgspec.Raw(msgspec.json.encode(openapi_document()))


async def _describe() -> Response:
    return json_answer(_description())
