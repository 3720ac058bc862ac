"""Sends observers to the console or to a relay for pictures, sound and feedback (docs/relay.md)."""

from typing import Annotated

import msgspec
from fastapi import APIRouter, Depends, Query, Request, Response

from lockstep.server.auth.tokens import Right
from lockstep.server.sfu.tickets import RelayAnswer, RelayTicket, without_key
from lockstep.server.state.dependencies import authorized, dependencies

__all__ = ["router"]

router = APIRouter()


@router.get("/api/relay")
async def relay(
    request: Request,
    caller: Annotated[Right, Depends(authorized)],
    peer: Annotated[str, Query(max_length=16)] = "",
    lost: Annotated[str, Query(max_length=40)] = "",
) -> Response:
    """Operators and supervisors are always connected directly. `peer` is an observer that is connected beside a relay.

    Only such a one gets what lets it in, so everyone who watches is a participant. `lost`: RELAY-FEED, which it lost.
    """
    here = dependencies(request)
    ticket: RelayTicket | None = None
    if caller.role == "observer":
        known = here.console.peers.by_id(peer) if peer else None
        is_own = known is not None and known.identity.token_id == caller.token_id and known.liveness.connected
        own = known if is_own else None
        ticket = here.relays.key(own) if own is not None and not lost else None
        if ticket is None:
            ticket = await here.relays.ticket(own, lost)
        if ticket is not None and (own is None or own.ended or caller.token_id != own.identity.token_id):
            ticket = without_key(ticket)
        elif own is not None and ticket is not None:
            own.relay = ticket.relay
            ticket = here.relays.key(own)
    body = msgspec.json.encode(RelayAnswer(ticket))
    return Response(body, media_type="application/json", headers={"Cache-Control": "no-store"})
