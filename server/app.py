"""The console's app for one robot, put together in one place: routes, middleware, error map, lifespan."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, closing
from functools import cache

import msgspec
from fastapi import FastAPI, Response
from starlette.types import Lifespan

from server import api, api_access, api_ice, api_recordings, api_relay, scene_proxy, watch, whep, whip
from server.bare_app import bare_app, guard_app, open_house
from server.json_answer import json_answer
from server.log_context import LogContext
from server.metrics import Metrics
from server.openapi import openapi_document
from server.page import page_router
from server.robot_session import run_on, running_session
from server.services import Services
from server.settings import Settings
from server.state import ConsoleState
from server.sweeper import sweep_forever

__all__ = ["attach_session", "create_app", "session_app"]


def create_app(settings: Settings, state: ConsoleState | None = None) -> FastAPI:
    """The app. It connects to the robot while its lifespan runs; `state` stands in for what the settings name."""

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        metrics = Metrics()
        with closing(open_house(app, settings, state, metrics)) as house:
            async with running_session(settings, house, metrics, house.state.directory) as made:
                attach_session(app, made)
                peers, clock = made.console.peers, made.console.clock
                async with asyncio.TaskGroup() as tasks:
                    running = [
                        tasks.create_task(house.run(), name="links"),
                        tasks.create_task(
                            run_on(
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
    guard_app(app, settings)
    return app


def session_app(settings: Settings, lifespan: Lifespan[FastAPI] | None = None) -> FastAPI:
    """The routes of one robot but for its pages. They need `app.state.house`, and answer by `attach_session`."""
    app = bare_app("Lockstep", settings, lifespan)
    app.include_router(whep.router)
    app.include_router(whip.router)
    app.include_router(api.router)
    app.include_router(api_access.router)
    app.include_router(api_ice.router)
    app.include_router(api_recordings.router)
    app.include_router(api_relay.router)
    app.include_router(scene_proxy.router)
    app.include_router(watch.router)
    app.add_middleware(LogContext)
    return app


def attach_session(app: FastAPI, session: Services | None) -> None:
    """From now on the routes speak for that session; None: it has failed, and they say so."""
    app.state.services = session
    app.state.recordings = None if session is None else session.recordings


@cache
def _description() -> msgspec.Raw:
    """Made once: it is large, and anybody may ask for it."""
    return msgspec.Raw(msgspec.json.encode(openapi_document()))


async def _describe() -> Response:
    return json_answer(_description())
