"""The app of a console with several robots: the overview in front, and each robot's routes below /robots/NAME/."""

from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager, closing
from functools import cache

import msgspec
from fastapi import FastAPI, Request, Response
from starlette.routing import Mount

from server.bare_app import bare_app, guard_app, open_house
from server.board import make_board
from server.errors import NotFound
from server.fleet import api_audit, api_fleet
from server.fleet.fleet import Fleet, fleet_of
from server.fleet.fleet_openapi import fleet_openapi
from server.json_answer import json_answer
from server.page import page_router
from server.robot_paths import ROBOTS
from server.settings import Settings
from server.state import ConsoleState

__all__ = ["create_fleet_app"]


def create_fleet_app(settings: Settings, robots: Mapping[str, Settings], state: ConsoleState | None = None) -> FastAPI:
    """The app. It connects to the robots while its lifespan runs; `robots` are their settings by name."""
    fleet = Fleet(robots)

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        opened = open_house(app, settings, state, fleet.metrics, settings.max_total_peers, settings.reserved_places)
        with closing(opened) as house:
            board = make_board(
                settings,
                house.state.signing_key(settings),
                fleet,
                house.state.invitations,
                settings.public_url,
                fleet.metrics.registry,
            )
            async with fleet.running(house, board):
                yield

    app = bare_app("Lockstep fleet", settings, lifespan)
    app.state.fleet = fleet
    app.include_router(api_fleet.router)
    app.include_router(api_audit.router)
    app.add_api_route("/openapi.json", _describe, include_in_schema=False)
    for name, session in fleet.sessions.items():
        app.router.routes.append(Mount(f"{ROBOTS}/{name}", app=session.app))
    app.add_api_route(f"{ROBOTS}/{{name}}", _with_slash, include_in_schema=False)
    app.include_router(page_router(first="fleet.html", of_robot=False))
    guard_app(app, settings)
    return app


async def _with_slash(request: Request, name: str) -> Response:
    """Pages find everything by their own address, which ends with a slash. A browser keeps the fragment."""
    if name not in fleet_of(request).sessions:
        raise NotFound("no such robot")
    return Response(status_code=308, headers={"Location": f"{name}/"})


@cache
def _description() -> msgspec.Raw:
    """Made once: it is large, and anybody may ask for it."""
    return msgspec.Raw(msgspec.json.encode(fleet_openapi()))


async def _describe() -> Response:
    return json_answer(_description())
