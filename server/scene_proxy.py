"""Reverse proxy for viser: /scene/ is its client, /scene/ws/TICKET its WebSocket.

Only camera movements pass from the viewer to viser. Its protocol knows much more (one message opens a tunnel to the
public Internet), and none of that is a viewer's business.
"""

import asyncio

import httpx
import msgspec
import structlog
from fastapi import APIRouter, Request, Response, WebSocket
from starlette.websockets import WebSocketDisconnect
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed
from websockets.typing import Subprotocol

from server.errors import ConsoleError, NotFound, SceneUnavailable
from server.scene import SceneView
from server.security import check_origin
from server.services import services

__all__ = ["HOOK", "is_allowed", "router"]

log = structlog.get_logger(__name__)

UPSTREAM_TIMEOUT = 5.0  # s
MAX_DOWN = 16 << 20  # bytes of one message from viser; meshes are the largest
DOWN_QUEUE = 2  # messages read ahead; then viser waits, and keeps only the newest of each kind
ALLOWED_UP = frozenset({"ViewerCameraMessage"})
TRY_AGAIN_LATER = 1013  # RFC 6455 7.4.1 and the IANA registry
POLICY_VIOLATION = 1008
GOING_AWAY = 1001
UNSUPPORTED_DATA = 1003

# The page around the frame puts its gate into it before viser's own script runs (web/src/ui/scene_frame.ts).
HOOK = b"<head><script>window.parent.lockstepScene?.(window)</script>"

router = APIRouter()


@router.get("/scene/{path:path}")
async def client(request: Request, path: str) -> Response:
    """viser's client: static files, which need no ticket."""
    scene = services(request).scene_or_error()
    try:
        async with httpx.AsyncClient(timeout=UPSTREAM_TIMEOUT, trust_env=False) as upstream:
            answer = await upstream.get(
                f"http://127.0.0.1:{scene.port}/{path}", headers={"Accept-Encoding": "identity"}
            )
    except httpx.HTTPError as error:
        raise SceneUnavailable("the 3D scene does not answer") from error
    if answer.status_code != 200:
        raise NotFound("no such file")
    kind = answer.headers.get("content-type", "application/octet-stream")
    content = answer.content.replace(b"<head>", HOOK, 1) if kind.startswith("text/html") else answer.content
    return Response(content, media_type=kind, headers={"Cache-Control": "no-cache"})


@router.websocket("/scene/ws/{ticket}")
async def stream(websocket: WebSocket, ticket: str) -> None:
    here = services(websocket)
    try:
        check_origin(websocket.headers, here.settings.allowed_origins)
        link = here.access.verify_ticket(ticket)
        scene = here.scene_or_error()
        with scene.viewer():
            await _join(websocket, scene, link)
    except ConsoleError as error:
        here.metrics.bad_input.labels("scene", type(error).__name__).inc()
        await websocket.close(POLICY_VIOLATION)


def is_allowed(data: bytes) -> bool:
    """Whether a viewer's message may pass."""
    try:
        kind = _kind.decode(data).type
    except (msgspec.DecodeError, UnicodeError, RecursionError):
        return False
    return kind in ALLOWED_UP


class _Kind(msgspec.Struct):
    type: str


_kind = msgspec.msgpack.Decoder(_Kind)


def _subprotocols(websocket: WebSocket) -> list[Subprotocol]:
    """viser's client names its version here; viser answers with the same or closes."""
    offered: list[str] = websocket.scope.get("subprotocols", [])
    return [Subprotocol(each) for each in offered if each.startswith("viser-v")][:1]


async def _join(websocket: WebSocket, scene: SceneView, link: str) -> None:
    subprotocols = _subprotocols(websocket)
    try:
        upstream = await connect(
            f"ws://127.0.0.1:{scene.port}/",
            subprotocols=subprotocols or None,
            compression=None,
            max_size=MAX_DOWN,
            max_queue=DOWN_QUEUE,
            open_timeout=UPSTREAM_TIMEOUT,
            close_timeout=1.0,
            proxy=None,
        )
    except (OSError, TimeoutError, ConnectionClosed) as error:
        log.warning("the 3D scene does not answer", error=str(error))
        await websocket.close(TRY_AGAIN_LATER)
        return
    async with upstream:
        await websocket.accept(subprotocol=upstream.subprotocol)
        up = asyncio.create_task(_viewer_to_scene(websocket, upstream))
        down = asyncio.create_task(_scene_to_viewer(websocket, upstream))
        revoked = asyncio.create_task(services(websocket).warden.revoked(link))
        try:
            await asyncio.wait((up, down, revoked), return_when=asyncio.FIRST_COMPLETED)
            if revoked.done():
                await websocket.close(POLICY_VIOLATION)
        finally:
            for task in (up, down, revoked):
                task.cancel()
            await asyncio.gather(up, down, revoked, return_exceptions=True)


async def _viewer_to_scene(websocket: WebSocket, upstream: ClientConnection) -> None:
    here = services(websocket)
    try:
        while True:
            data = await websocket.receive_bytes()
            if is_allowed(data):
                await upstream.send(data)
            else:
                here.metrics.bad_input.labels("scene", "not_allowed").inc()
    except KeyError:
        # starlette: a text message has no bytes
        here.metrics.bad_input.labels("scene", "text").inc()
        await websocket.close(UNSUPPORTED_DATA)
    except (WebSocketDisconnect, ConnectionClosed):
        return


async def _scene_to_viewer(websocket: WebSocket, upstream: ClientConnection) -> None:
    try:
        async for data in upstream:
            await websocket.send_bytes(data if isinstance(data, bytes) else data.encode())
        await websocket.close(GOING_AWAY)
    except (WebSocketDisconnect, ConnectionClosed, RuntimeError):
        return  # the viewer is gone; starlette says so by any of these
