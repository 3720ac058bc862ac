"""Actions and status over HTTP (docs/console-api.md, "Actions")."""

import time
from typing import Annotated

import msgspec
from fastapi import APIRouter, Depends, Request, Response

from lockstep.protocol.actions import ActionUpdate, Parameters, RenewedAction, Status
from lockstep.protocol.console import PEOPLE
from lockstep.server.auth.tokens import Right
from lockstep.server.errors import NoSeat, NotAllowed
from lockstep.server.http.json_response import json_answer
from lockstep.server.http.request_body import read_json
from lockstep.server.state.dependencies import authorized, dependencies

__all__ = ["ActionList", "ActionRequest", "RobotStatus", "router"]

router = APIRouter()
Nonce = Annotated[int, msgspec.Meta(ge=0, le=2**53 - 1)]
Caller = Annotated[Right, Depends(authorized)]


class ActionList(msgspec.Struct, frozen=True):
    """Answer of GET /api/actions: how the newest actions do, oldest first."""

    actions: list[ActionUpdate]


class ActionRequest(msgspec.Struct, frozen=True):
    """Body of POST /api/actions/{name}."""

    parameters: Parameters = {}
    id: RenewedAction = ""  # of the request: the same id begins nothing again; "": the console draws one
    nonce: Nonce | None = None  # of a recent feedback; null: the console takes the newest


class RobotStatus(msgspec.Struct, frozen=True):
    """Answer of GET /api/status."""

    status: Status | None  # None before the robot said any; the ages are those of now


@router.get("/api/actions")
async def actions(request: Request, caller: Caller) -> Response:
    return json_answer(ActionList(dependencies(request).console.actions.newest()))


@router.post("/api/actions/{action}")
async def act(request: Request, caller: Caller, action: str) -> Response:
    """The holder of the control seat, with the action's name. The right is looked at again once the body has come."""
    wanted = await read_json(request, ActionRequest)
    caller = await authorized(request)
    console = dependencies(request).console
    if caller.role not in PEOPLE:
        raise NotAllowed("only people may ask for actions")
    if not console.seat.is_held_with(caller.identity.token_id):
        raise NoSeat("take the control seat first, with a connection of this link")
    return json_answer(
        await console.actions.act_by_http(caller.actor, action, wanted.parameters, wanted.id, wanted.nonce)
    )


@router.delete("/api/actions/{action}")
async def cancel(request: Request, caller: Caller, action: str) -> Response:
    """The holder of the control seat, or a supervisor, with the id of the request that began the action."""
    console = dependencies(request).console
    if caller.role not in PEOPLE:
        raise NotAllowed("only people may cancel actions")
    if caller.role != "supervisor" and not console.seat.is_held_with(caller.identity.token_id):
        raise NoSeat("take the control seat first, with a connection of this link")
    return json_answer(await console.actions.cancel_by_http(caller.actor, action))


@router.get("/api/status")
async def status(request: Request, caller: Caller) -> Response:
    return json_answer(RobotStatus(dependencies(request).console.status.message(time.monotonic())))
