"""A proxy of the 3D scene: /scene/TICKET/ is viser's client, from memory, /scene/ws/TICKET its WebSocket.

The client runs what recordings and messages tell it to, so it has no rights here: its page is sandboxed into an opaque
origin (`SCENE_POLICY`), and takes no parameters but those that the console gives it. Only camera movements pass from
the viewer to viser. Its protocol has many more messages (one opens a tunnel to the public Internet), which no viewer
needs.
"""

import asyncio
from contextlib import suppress

import msgspec
import structlog
from fastapi import APIRouter, Request, Response, WebSocket
from starlette.websockets import WebSocketDisconnect
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed
from websockets.typing import Subprotocol

from lockstep.rtc.token_bucket import TokenBucket
from lockstep.server.auth.tokens import SceneTicket
from lockstep.server.errors import BadParameter, ConsoleError, NotFound
from lockstep.server.http.security_headers import check_origin
from lockstep.server.scene.view import SceneView
from lockstep.server.state.dependencies import Dependencies, dependencies

__all__ = ["is_allowed", "router", "scene_query"]

log = structlog.get_logger(__name__)

UPSTREAM_TIMEOUT = 5.0  # s
MAX_DOWN = 16 << 20  # bytes of one message from viser; meshes are the largest
DOWN_QUEUE = 2  # messages read ahead; then viser waits, and keeps only the newest of each kind
ALLOWED_UP = frozenset({"ViewerCameraMessage"})
UP_RATE, UP_BURST = 60.0, 120.0  # Hz, messages of one viewer; faster ones wait at the sender
TRY_AGAIN_LATER = 1013  # RFC 6455 7.4.1 and the IANA registry
POLICY_VIOLATION = 1008
GOING_AWAY = 1001
UNSUPPORTED_DATA = 1003
GONE = (WebSocketDisconnect, RuntimeError)  # what starlette raises when the viewer is gone, or was sent away

OPAQUE = "null"  # as a browser names the origin of a sandboxed page (HTML 7.1.1)
FLAGS = ("darkMode", "hideViserLogo")  # for viser's client, without a value

router = APIRouter()


@router.get("/scene/{ticket}/")
async def client(request: Request, ticket: str) -> Response:
    """viser's client for whoever has a ticket."""
    here = dependencies(request)
    here.access.verify_ticket(ticket)
    _check_query(request, ticket)
    scene = here.scene_or_error()
    await scene.open()
    here.access.verify_ticket(ticket)  # its link may have ended meanwhile
    headers = {"Cache-Control": "no-store", "Vary": "Accept-Encoding"}
    if "gzip" not in request.headers.get("accept-encoding", ""):
        return Response(scene.page.plain, media_type="text/html", headers=headers)
    return Response(scene.page.packed, media_type="text/html", headers=headers | {"Content-Encoding": "gzip"})


@router.get("/scene/{path:path}")
async def nothing(path: str) -> Response:
    raise NotFound("no such file")


def scene_query(request: Request, ticket: str) -> str:
    """Return the parameters of viser's client: the address of its stream, and its appearance."""
    root = str(request.scope.get("root_path", ""))
    base = str(request.base_url.replace(path="")).replace("http", "ws", 1).rstrip("/")
    return "&".join((f"websocket={base}{root}/scene/ws/{ticket}", *FLAGS))


def _check_query(request: Request, ticket: str) -> None:
    """Raise BadParameter unless the query is that of `scene_query`: one of viser's parameters loads any script."""
    known = dict.fromkeys(FLAGS, "") | dict([scene_query(request, ticket).partition("&")[0].split("=", 1)])
    for name, value in request.query_params.multi_items():
        if name not in known:
            raise BadParameter(f"the 3D scene has no parameter {name[:40]!r}")
        if value != known[name]:
            raise BadParameter(f"the 3D scene takes no other value of {name!r}")


@router.websocket("/scene/ws/{ticket}")
async def stream(websocket: WebSocket, ticket: str) -> None:
    try:
        here = dependencies(websocket)
    except ConsoleError:
        await websocket.close(TRY_AGAIN_LATER)  # this robot's session is started again
        return
    try:
        valid = here.access.verify_ticket(ticket)
        if websocket.headers.get("origin") != OPAQUE:
            check_origin(websocket.headers, here.settings.allowed_origins)
        scene = here.scene_or_error()
        await scene.open()
        here.access.verify_ticket(ticket)  # its link may have ended meanwhile
        with scene.viewer(valid):
            await _join(websocket, here, scene, valid)
    except ConsoleError as error:
        here.metrics.bad_input.labels("scene", type(error).__name__).inc()
        await websocket.close(POLICY_VIOLATION)


def is_allowed(data: bytes) -> bool:
    """True if a viewer's message may pass."""
    try:
        kind = _kind.decode(data).type
    except (msgspec.DecodeError, UnicodeError, RecursionError):
        return False
    return kind in ALLOWED_UP


class _Kind(msgspec.Struct):
    type: str


_kind = msgspec.msgpack.Decoder(_Kind)


def _subprotocols(websocket: WebSocket) -> list[Subprotocol]:
    """Return the version that viser's client names; viser answers with the same or closes."""
    offered: list[str] = websocket.scope.get("subprotocols", [])
    return [Subprotocol(each) for each in offered if each.startswith("viser-v")][:1]


async def _join(websocket: WebSocket, here: Dependencies, scene: SceneView, ticket: SceneTicket) -> None:
    subprotocols = _subprotocols(websocket)
    try:
        upstream = await connect(
            f"ws://127.0.0.1:{scene.renderer.port}/",
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
        async with asyncio.TaskGroup() as tasks:
            up = tasks.create_task(_viewer_to_scene(websocket, here, upstream))
            down = tasks.create_task(_scene_to_viewer(websocket, upstream))
            ended = tasks.create_task(here.revocation.ended(ticket.link, ticket.ends))
            await asyncio.wait((up, down, ended), return_when=asyncio.FIRST_COMPLETED)
            if ended.done():
                await _close(websocket, POLICY_VIOLATION)
            for task in (up, down, ended):
                task.cancel()


async def _viewer_to_scene(websocket: WebSocket, here: Dependencies, upstream: ClientConnection) -> None:
    clock = asyncio.get_running_loop().time
    budget = TokenBucket(UP_RATE, UP_BURST)
    try:
        while True:
            data = await websocket.receive_bytes()
            if not budget.take(clock()):  # viser's thread, which handles it, takes time from everybody
                await asyncio.sleep(budget.wait(clock()))
                budget.take(clock())
            if is_allowed(data):
                await upstream.send(data)
            else:
                here.metrics.bad_input.labels("scene", "not_allowed").inc()
    except KeyError:
        # starlette: a text message has no bytes
        here.metrics.bad_input.labels("scene", "text").inc()
        await _close(websocket, UNSUPPORTED_DATA)
    except (*GONE, ConnectionClosed):
        return


async def _scene_to_viewer(websocket: WebSocket, upstream: ClientConnection) -> None:
    try:
        async for data in upstream:
            await websocket.send_bytes(data if isinstance(data, bytes) else data.encode())
        await websocket.close(GOING_AWAY)
    except (*GONE, ConnectionClosed):
        return


async def _close(websocket: WebSocket, code: int) -> None:
    with suppress(*GONE):
        await websocket.close(code)
