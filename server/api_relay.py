"""Where an observer gets pictures, sound and feedback: from the console, or through a relay (docs/relay.md)."""

from typing import Annotated

import msgspec
from fastapi import APIRouter, Depends, Query, Request, Response

from server.access import Identity
from server.relay.tickets import RelayAnswer
from server.services import authorized, services

__all__ = ["router"]

router = APIRouter()


@router.get("/api/relay")
async def relay(
    request: Request,
    caller: Annotated[Identity, Depends(authorized)],
    peer: Annotated[str, Query(max_length=16)] = "",
    lost: Annotated[str, Query(max_length=40)] = "",
) -> Response:
    """Operators and supervisors are always connected directly. `peer` is an observer that lost RELAY-FEED."""
    here = services(request)
    ticket = None
    if caller.role == "observer":
        known = here.console.peers.by_id(peer) if peer else None
        own = known if known is not None and known.identity.token_id == caller.token_id else None
        ticket = await here.relays.ticket(own, lost)
        if own is not None and ticket is not None:
            own.relay = ticket.relay
    body = msgspec.json.encode(RelayAnswer(ticket))
    return Response(body, media_type="application/json", headers={"Cache-Control": "no-store"})
