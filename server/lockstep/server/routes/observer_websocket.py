"""The WebSocket of an observer behind a relay: POST /api/watch for a ticket, then /watch/TICKET."""

from typing import Annotated

import msgspec
from fastapi import APIRouter, Depends, Query, Request, Response, WebSocket
from starlette.websockets import WebSocketDisconnect

from lockstep.server.auth.tokens import Right, require_role
from lockstep.server.errors import ConsoleError, NotFound, RobotUnreachable
from lockstep.server.http.json_response import json_answer
from lockstep.server.http.security_headers import check_origin
from lockstep.server.peers.websocket_transport import POLICY_VIOLATION, TICKET_SECONDS, LineEnded, peer_beside_relay
from lockstep.server.state.dependencies import authorized, dependencies

__all__ = ["WatchTicket", "router"]

TRY_AGAIN_LATER = 1013  # the IANA registry

router = APIRouter()


class WatchTicket(msgspec.Struct, frozen=True):
    ticket: str  # opens one WebSocket: /watch/TICKET
    seconds: float  # of its validity


@router.post("/api/watch")
async def invite(
    request: Request,
    caller: Annotated[Right, Depends(authorized)],
    relay: Annotated[str, Query(pattern=r"^\d{1,3}$")],
) -> Response:
    """Admit an observer that has its media from `relay`. Its place is free again when no line comes in time."""
    here = dependencies(request)
    require_role(caller, "observer")
    identity = caller.identity
    if here.console.robot.description is None:
        raise RobotUnreachable(here.console.robot.detail)
    here.request_limits.offer(identity.token_id)
    if not here.relays.arrived(relay):
        raise NotFound("no such relay")
    with here.console.peers.places.keep(identity, relayed=True):
        turns = here.console.peers.turns
        watcher, transport = peer_beside_relay(relay, identity, here.console, here.settings, turns)
        here.console.peers.admit(watcher)
    return json_answer(WatchTicket(transport.ticket, TICKET_SECONDS), 201)


@router.delete("/watch/{ticket}")
async def decline(ticket: str, request: Request, caller: Annotated[Right, Depends(authorized)]) -> Response:
    """Give a ticket back that cannot be used, as behind a proxy that lets no WebSocket pass."""
    watcher, _ = dependencies(request).console.peers.by_ticket(ticket)
    if watcher.identity.token_id != caller.token_id:
        raise NotFound("no such ticket")
    watcher.end("deleted")
    return Response(status_code=200)


@router.websocket("/watch/{ticket}")
async def line(websocket: WebSocket, ticket: str) -> None:
    try:
        here = dependencies(websocket)
    except ConsoleError:
        await websocket.close(TRY_AGAIN_LATER)  # this robot's session is started again
        return
    try:
        check_origin(websocket.headers, here.settings.allowed_origins)
        watcher, transport = here.console.peers.by_ticket(ticket)
    except ConsoleError as error:
        here.metrics.bad_input.labels("watch", type(error).__name__).inc()
        await websocket.close(POLICY_VIOLATION)
        return
    transport.ticket = ""
    try:
        await websocket.accept()
        await transport.serve(_WebSocketLine(websocket))
    except OSError:
        watcher.end("line closed")  # gone before it was accepted
    except Exception as error:
        watcher.failed("line", error)  # a fault of one connection must not reach uvicorn


class _WebSocketLine:
    """starlette's WebSocket as a Line."""

    def __init__(self, websocket: WebSocket) -> None:
        self._websocket = websocket

    async def receive(self) -> str | bytes:
        message = await self._websocket.receive()
        if message["type"] == "websocket.disconnect":
            raise LineEnded(message.get("code", 0))
        text: str | None = message.get("text")
        binary: bytes = message.get("bytes") or b""
        return binary if text is None else text

    async def send(self, text: str) -> None:
        try:
            await self._websocket.send_text(text)
        except (WebSocketDisconnect, RuntimeError) as error:
            raise LineEnded(0) from error  # starlette raises either

    async def close(self, code: int, reason: str) -> None:
        try:
            await self._websocket.close(code, reason)
        except (WebSocketDisconnect, RuntimeError) as error:
            raise LineEnded(0) from error
