"""The control seat over HTTP: taking over from a policy, and letting one drive (docs/policies.md)."""

from typing import Annotated

import msgspec
from fastapi import APIRouter, Depends, Request, Response

from lockstep.protocol.console import Seat
from lockstep.server.auth.tokens import Right
from lockstep.server.errors import NotAllowed, RobotLinkDown
from lockstep.server.http.json_response import json_answer
from lockstep.server.http.request_body import read_json
from lockstep.server.state.dependencies import authorized, dependencies

__all__ = ["OfferRequest", "Seat", "router"]

router = APIRouter()
Caller = Annotated[Right, Depends(authorized)]


class OfferRequest(msgspec.Struct, frozen=True):
    """Body of POST /api/seat/offer."""

    offered: bool = True  # False: withdraw the offer, which rests the robot if a policy drives
    peer: Annotated[str, msgspec.Meta(max_length=60)] = ""  # the only policy that may take the seat; "": any


@router.get("/api/seat")
async def seat(request: Request, caller: Caller) -> Response:
    return json_answer(dependencies(request).console.seat.message())


@router.post("/api/seat/take_over")
async def take_over(request: Request, caller: Caller) -> Response:
    """An operator or a supervisor; the body is not read: the press of a person waits for nothing."""
    console = dependencies(request).console
    console.seat_by_link.take(caller.token_id, caller.actor)
    return json_answer(console.seat.message())


@router.post("/api/seat/offer")
async def offer(request: Request, caller: Caller) -> Response:
    """An operator or a supervisor who is connected. The right is looked at again once the body has come."""
    wanted = await read_json(request, OfferRequest)
    caller = await authorized(request)
    console = dependencies(request).console
    if not wanted.offered:
        console.seat_by_link.withdraw(caller.actor)
        return json_answer(console.seat.message())
    match console.why_no_offer():
        case "link_down":
            raise RobotLinkDown(console.robot.detail)
        case "stopped":
            raise NotAllowed("the robot is stopped")
    console.seat_by_link.offer(caller.token_id, caller.actor, policy=wanted.peer)
    return json_answer(console.seat.message())
