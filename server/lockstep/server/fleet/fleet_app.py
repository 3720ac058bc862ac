"""The app of a console with several robots: the overview in front, and each robot's routes below /robots/NAME/."""

from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager, closing
from functools import cache

import msgspec
from fastapi import FastAPI, Request, Response
from starlette.routing import Mount

from lockstep.server.composition.app_factory import add_middleware, bare_app, open_context
from lockstep.server.errors import NotFound
from lockstep.server.federation import make_board
from lockstep.server.fleet import audit_routes, fleet_routes
from lockstep.server.fleet.board_host import FleetBoardHost
from lockstep.server.fleet.fleet import Fleet, fleet_of
from lockstep.server.fleet.openapi import fleet_openapi
from lockstep.server.http.json_response import json_answer
from lockstep.server.http.robot_paths import ROBOTS
from lockstep.server.http.static_files import page_router
from lockstep.server.settings import Settings
from lockstep.server.state.persistent_state import ConsoleState

__all__ = ["create_fleet_app"]


def create_fleet_app(settings: Settings, robots: Mapping[str, Settings], state: ConsoleState | None = None) -> FastAPI:
    """Return the app, which connects to the robots in its lifespan. `robots`: their settings by name."""
    fleet = Fleet(robots)

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        opened = open_context(app, settings, state, fleet.metrics, settings.max_total_peers, settings.reserved_places)
        with closing(opened) as context:
            board = make_board(
                settings,
                context.state.signing_key(settings),
                FleetBoardHost(fleet.sessions, context, fleet.metrics.faults),
                context.state.invitations,
                settings.public_url,
                fleet.metrics.registry,
            )
            async with fleet.running(context, board):
                yield

    app = bare_app("Lockstep fleet", settings, lifespan)
    app.state.fleet = fleet
    app.include_router(fleet_routes.router)
    app.include_router(audit_routes.router)
    app.add_api_route("/openapi.json", _describe, include_in_schema=False)
    for name, session in fleet.sessions.items():
        app.router.routes.append(Mount(f"{ROBOTS}/{name}", app=session.app))
    app.add_api_route(f"{ROBOTS}/{{name}}", _with_slash, include_in_schema=False)
    app.include_router(page_router(first="fleet.html", of_robot=False))
    add_middleware(app, settings)
    return app


async def _with_slash(request: Request, name: str) -> Response:
    """Pages find everything by their own address, which ends with a slash. A browser keeps the fragment."""
    if name not in fleet_of(request).sessions:
        raise NotFound("no such robot")
    return Response(status_code=308, headers={"Location": f"{name}/"})


@cache
def _description() -> msgspec.Raw:
    """Return the OpenAPI document, made once: it is large, and anybody may ask for it."""
    return msgspec.Raw(msgspec.json.encode(fleet_openapi()))


async def _describe() -> Response:
    return json_answer(_description())
