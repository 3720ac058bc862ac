"""STUN and TURN servers for who has a token: GET /api/ice, and the same as Link headers of the WHEP answer."""

import time
from typing import Annotated

import msgspec
from fastapi import APIRouter, Depends, Request, Response

from server.access import Identity
from server.ice_servers import IceServers, ice_servers
from server.services import authorized, services
from server.settings import Settings

__all__ = ["router", "servers_for"]

router = APIRouter()


@router.get("/api/ice")
async def ice(request: Request, caller: Annotated[Identity, Depends(authorized)]) -> Response:
    body = msgspec.json.encode(servers_for(services(request).settings, caller.token_id))
    return Response(body, media_type="application/json", headers={"Cache-Control": "no-store"})


def servers_for(settings: Settings, user: str) -> IceServers:
    """What `user` may use from now on; the name shows in the TURN server's log."""
    return ice_servers(settings.stun, settings.turn, settings.turn_key, settings.turn_seconds, user, time.time())
