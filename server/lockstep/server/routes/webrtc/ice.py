"""STUN and TURN servers for holders of a token: GET /api/ice, and the same as Link headers of the WHEP answer."""

import time
from typing import Annotated

import msgspec
from fastapi import APIRouter, Depends, Request, Response

from lockstep.server.auth.tokens import Identity, Right
from lockstep.server.settings import Settings
from lockstep.server.state.dependencies import authorized, dependencies
from lockstep.server.webrtc.ice_servers import IceServers, ice_servers

__all__ = ["router", "servers_for"]

router = APIRouter()


@router.get("/api/ice")
async def ice(request: Request, caller: Annotated[Right, Depends(authorized)]) -> Response:
    body = msgspec.json.encode(servers_for(dependencies(request).settings, caller.identity))
    return Response(body, media_type="application/json", headers={"Cache-Control": "no-store"})


def servers_for(settings: Settings, user: Identity) -> IceServers:
    """Return the servers that `user` may use from now on; the link's id shows in the TURN server's log."""
    now = time.time()  # on the TURN server's clock
    seconds = min(settings.turn_seconds, max(0.0, user.expires - now))
    return ice_servers(settings.stun, settings.turn, settings.turn_key, seconds, user.token_id, now)
