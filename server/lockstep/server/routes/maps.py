"""The robot's map over HTTP (docs/console-api.md, "Maps")."""

from typing import Annotated

import msgspec
from fastapi import APIRouter, Depends, Request, Response

from lockstep.protocol.maps import OccupancyMap
from lockstep.server.auth.tokens import Right
from lockstep.server.errors import NotFound
from lockstep.server.http.json_response import json_answer
from lockstep.server.state.dependencies import authorized, dependencies

__all__ = ["NewestMap", "router"]

router = APIRouter()
Caller = Annotated[Right, Depends(authorized)]


class NewestMap(msgspec.Struct, frozen=True):
    """Answer of GET /api/map. `cells` of the map are in base64."""

    map: OccupancyMap


@router.get("/api/map")
async def newest_map(request: Request, caller: Caller) -> Response:
    newest = dependencies(request).console.navigation.map
    if newest is None:
        raise NotFound("the robot has sent no map")
    return json_answer(NewestMap(newest))
