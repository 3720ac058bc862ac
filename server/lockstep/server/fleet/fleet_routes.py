"""The HTTP API of a fleet: the overview's state, STOP for all, health, metrics (docs/console-api.md)."""

import time
from dataclasses import dataclass
from typing import Annotated, Literal

import msgspec
from fastapi import APIRouter, Depends, Request, Response

from lockstep.protocol.console import PEOPLE, Role
from lockstep.server.auth.tokens import Right
from lockstep.server.errors import LinkOtherRobot
from lockstep.server.federation.board import BoardState
from lockstep.server.federation.robot_summary import Tile
from lockstep.server.fleet.fleet import Fleet, fleet_caller, fleet_of
from lockstep.server.fleet.robot_stop import Stopped
from lockstep.server.http.json_response import json_answer
from lockstep.server.routes.stop_body import read_stop
from lockstep.server.stop.stop_presses import new_press, told_id

__all__ = ["FleetHealth", "FleetInfo", "FleetReadiness", "FleetStop", "RobotTile", "router"]

router = APIRouter()


Caller = Annotated[Right, Depends(fleet_caller)]


@dataclass(frozen=True, kw_only=True)
class RobotTile(Tile):
    """A tile as one caller sees it."""

    role_may_drive: bool


class Notice(msgspec.Struct, frozen=True):
    """For the whole page."""

    level: Literal["warning", "error"]
    text: str


class You(msgspec.Struct, frozen=True):
    role: Role
    name: str


class FleetInfo(msgspec.Struct, frozen=True, kw_only=True):
    """Answer of GET /api/fleet."""

    you: You
    time: float  # s since 1970, the console's clock: for people
    robots: list[RobotTile]  # by name; those that the caller's link is good for
    consoles: BoardState
    notices: list[Notice]


class StoppedRobot(msgspec.Struct, frozen=True, kw_only=True):
    name: str
    delivered: bool
    event: int
    detail: str  # why it was not delivered
    number: int  # of the stop at that robot; 0 when it was not delivered
    console: str  # console of the robot; "" is this one
    kept: bool  # on that robot's disk; false when it was not delivered


class FleetStop(msgspec.Struct, frozen=True, kw_only=True):
    """Answer of POST /api/fleet/stop."""

    press: str
    robots: list[StoppedRobot]


class RobotHealth(msgspec.Struct, frozen=True, kw_only=True):
    robot_link: Literal["up", "down"]


class FleetHealth(msgspec.Struct, frozen=True, kw_only=True):
    """Answer of GET /healthz. `degraded`: the console runs, but some robot cannot be reached or nobody gets in."""

    status: Literal["ok", "degraded"]
    links: Literal["ok", "unreadable"]  # "unreadable": which links are revoked is unknown, so nobody gets in
    robots: dict[str, RobotHealth]


class FleetReadiness(msgspec.Struct, frozen=True, kw_only=True):
    """Answer of GET /readyz, 503 unless ready. A robot that is away does not make a console unready."""

    ready: bool
    unreachable: list[str]  # names of robots


@router.get("/api/fleet")
async def fleet(request: Request, caller: Caller) -> Response:
    here = fleet_of(request)
    may_drive = caller.role in PEOPLE
    return json_answer(
        FleetInfo(
            you=You(caller.role, caller.name),
            time=round(time.time(), 3),
            robots=[RobotTile(**vars(tile), role_may_drive=may_drive) for tile in here.tiles(caller.identity)],
            consoles=here.board.state,
            notices=_notices(here.board.state),
        )
    )


@router.post("/api/fleet/stop")
async def stop(request: Request, caller: Caller) -> Response:
    """Anyone with a token, for every robot that it is good for."""
    here = fleet_of(request)
    wanted = await read_stop(request)
    press = new_press(caller.actor, "http", wanted.reason, wanted.press)
    stopped = await here.stop_all(caller.identity, press)
    if not stopped:
        raise LinkOtherRobot("this link admits to none of the robots on this console")
    return json_answer(FleetStop(press=told_id(press, wanted.press), robots=[_stopped(each) for each in stopped]))


@router.get("/healthz")
async def healthz(request: Request) -> Response:
    """For anyone, so it says no address and no reason; the log does."""
    here = fleet_of(request)
    robots = _health(here)
    well = here.lets_in and all(each.robot_link == "up" for each in robots.values())
    links: Literal["ok", "unreadable"] = "ok" if here.lets_in else "unreadable"
    return json_answer(FleetHealth(status="ok" if well else "degraded", links=links, robots=robots))


@router.get("/readyz")
async def readyz(request: Request) -> Response:
    here = fleet_of(request)
    robots = _health(here)
    away = [name for name, each in robots.items() if each.robot_link == "down"]
    return json_answer(FleetReadiness(ready=here.lets_in, unreachable=away), 200 if here.lets_in else 503)


@router.get("/metrics")
async def metrics(request: Request) -> Response:
    metrics = fleet_of(request).metrics
    text = await metrics.exposition.text(metrics.collect)
    return Response(text, media_type="text/plain; version=0.0.4", headers={"Cache-Control": "no-store"})


def _health(here: Fleet) -> dict[str, RobotHealth]:
    return {tile.name: RobotHealth(robot_link="up" if tile.link == "up" else "down") for tile in here.own_tiles()}


def _stopped(each: Stopped) -> StoppedRobot:
    return StoppedRobot(**each._asdict())


def _notices(state: BoardState) -> list[Notice]:
    """Return the troubles among the consoles, in words."""
    found = []
    if state.unknown_since is not None:
        since = time.strftime("%H:%M:%S UTC", time.gmtime(state.unknown_since))
        found.append(Notice("warning", f"Other consoles are unknown since {since}: {state.detail or 'no answer'}"))
    elif state.detail:
        found.append(Notice("warning", f"Other consoles may not see this one: {state.detail}"))
    for each in state.conflicts:
        names = " and ".join(each.consoles)
        found.append(Notice("error", f"{each.error}: {names} both say that they have the robot {each.robot!r}."))
    return found
