"""The HTTP API besides WHEP: session, stop, reset, scene, health, metrics (docs/console-api.md)."""

from typing import Annotated

import msgspec
from fastapi import APIRouter, Depends, Request, Response

from lockstep.protocol.console import Participant, Seat, StreamInfo, StreamOffer
from lockstep.protocol.description import RobotDescription
from lockstep.protocol.messages import Feedback, StopNumber, StopState
from lockstep.server.auth.tokens import Right
from lockstep.server.errors import PressUsed
from lockstep.server.http.json_response import json_answer
from lockstep.server.http.request_body import read_json
from lockstep.server.routes.scene_proxy import scene_query
from lockstep.server.routes.stop_body import read_stop
from lockstep.server.state.dependencies import authorized, dependencies, takes_stops
from lockstep.server.stop.stop_presses import new_press, told_id

__all__ = ["Delivered", "Health", "Readiness", "Released", "ResetRequest", "ScenePath", "SessionInfo", "router"]

router = APIRouter()
Caller = Annotated[Right, Depends(authorized)]


class LinkInfo(msgspec.Struct, frozen=True, kw_only=True):
    up: bool
    detail: str  # why it is down


class SessionInfo(msgspec.Struct, frozen=True, kw_only=True):
    """Answer of GET /api/session."""

    epoch: str  # "" before the robot was reached
    event: int
    stopped: bool
    stop: StopState
    seat: Seat
    participants: list[Participant]
    link: LinkInfo
    you: dict[str, str]  # role and name of the token
    peers: dict[str, list[StreamInfo]]  # streams of each peer
    streams: list[StreamOffer]  # all streams; empty before the robot was reached
    voice: bool  # the console takes the voice of the seat's holder
    description: RobotDescription | None
    feedback: Feedback | None


class ResetRequest(msgspec.Struct, frozen=True):
    """Body of POST /api/reset."""

    number: StopNumber  # of the newest stop that the caller has seen


class Health(msgspec.Struct, frozen=True, kw_only=True):
    """Answer of GET /healthz. `degraded`: the console runs, but the robot cannot be reached or nobody gets in."""

    status: str
    robot_link: str
    links: str  # "ok"; "unreadable": which links are revoked is unknown, so nobody gets in


class Readiness(msgspec.Struct, frozen=True, kw_only=True):
    """Answer of GET /readyz, 503 unless ready. A robot that is away does not make a console unready."""

    ready: bool


class ScenePath(msgspec.Struct, frozen=True):
    """Answer of POST /api/scene."""

    path: str


class Delivered(msgspec.Struct, frozen=True):
    """Answer of POST /api/stop: the robot has latched it."""

    delivered: bool
    event: int
    number: int  # of the stop
    press: str
    kept: bool  # on the robot's disk


class Released(msgspec.Struct, frozen=True):
    """Answer of POST /api/reset: the robot says that this stop is released."""

    released: bool
    event: int
    number: int


@router.get("/api/session")
async def session(request: Request, caller: Caller) -> Response:
    console = dependencies(request).console
    return json_answer(
        SessionInfo(
            epoch=console.clock.epoch,
            event=console.clock.event,
            stopped=console.clock.stop.stopped,
            stop=console.clock.stop,
            seat=console.seat.message(),
            participants=console.people.current().participants,
            link=LinkInfo(up=console.robot.up, detail=console.robot.detail),
            you={"role": caller.role, "name": caller.name},
            peers={peer.id: peer.media.streams for peer in console.peers},
            streams=dependencies(request).media.offers,
            voice=dependencies(request).voice.enabled,
            description=console.robot.description,
            feedback=console.clock.feedback,
        )
    )


@router.post("/api/stop")
async def stop(request: Request) -> Response:
    """Anyone with a token, also while the robot's session has failed."""
    robot = takes_stops(request)
    caller = robot.access.bearer_to_stop(request.headers.get("authorization"))
    wanted = await read_stop(request)
    press = new_press(caller.actor, "http", wanted.reason, wanted.press)
    stopped = await robot.stop(press)
    if not stopped.outcome.delivered:
        raise stopped.error()
    if stopped.outcome.released:
        raise PressUsed(f"stop {stopped.outcome.number} of this press was reset; a new press needs another id, or none")
    told = told_id(press, wanted.press)
    return json_answer(Delivered(True, stopped.event, stopped.outcome.number, told, stopped.outcome.kept))


@router.post("/api/reset")
async def reset(request: Request, caller: Caller) -> Response:
    """The holder of the control seat, or a supervisor. The right is looked at again once the body has come."""
    wanted = await read_json(request, ResetRequest)
    caller = await authorized(request)
    console = dependencies(request).console
    await console.resets.reset(caller.actor, "http", wanted.number)
    return json_answer(Released(True, console.clock.event, wanted.number))


@router.post("/api/scene")
async def scene(request: Request, caller: Caller) -> Response:
    """A path for an iframe that shows the 3D scene; its ticket is good for a few minutes."""
    here = dependencies(request)
    await here.scene_or_error().open()
    root = str(request.scope.get("root_path", ""))
    ticket = here.access.issue_ticket(caller.identity)
    return json_answer(ScenePath(f"{root}/scene/{ticket}/?{scene_query(request, ticket)}"))


@router.get("/healthz")
async def healthz(request: Request) -> Response:
    """For anyone, so it says no address and no reason; the log does."""
    here = dependencies(request)
    up, readable = here.console.robot.up, not here.state.invitations.trouble
    health = Health(
        status="ok" if up and readable else "degraded",
        robot_link="up" if up else "down",
        links="ok" if readable else "unreadable",
    )
    return json_answer(health)


@router.get("/readyz")
async def readyz(request: Request) -> Response:
    """For anyone: whether requests may be sent here. /healthz says whether the robot can be reached too."""
    readable = not dependencies(request).state.invitations.trouble
    return json_answer(Readiness(ready=readable), 200 if readable else 503)


@router.get("/metrics")
async def metrics(request: Request) -> Response:
    here = dependencies(request)
    text = await here.metrics.exposition.text(here.collect)
    return Response(text, media_type="text/plain; version=0.0.4", headers={"Cache-Control": "no-store"})
