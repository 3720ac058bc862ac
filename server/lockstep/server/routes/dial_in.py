"""Robots that dial in: their WebSockets below /dial/, and the supervisor's requests to pair and forget one."""

import asyncio
import time
from typing import Annotated, Literal

import msgspec
from fastapi import APIRouter, Depends, Request, Response, WebSocket
from starlette.websockets import WebSocketDisconnect

from lockstep.protocol.dial_in import (
    MAX_PAIRING_MESSAGE,
    WAIT_HEADER,
    WAITS,
    PairingAnswer,
    PairingHello,
    PairingProof,
)
from lockstep.protocol.messages import LinkRole
from lockstep.server.audit.records import Actor
from lockstep.server.auth.tokens import Right, require_role
from lockstep.server.errors import (
    AlreadyPaired,
    ConsoleError,
    NotDialIn,
    NotFound,
    NotPairing,
    OriginRefused,
    RobotUnknown,
    StateUnavailable,
    TooManyRequests,
    http_error,
)
from lockstep.server.http.json_response import json_answer
from lockstep.server.http.problem import problem_response
from lockstep.server.http.transport.client_address import counted_address
from lockstep.server.http.transport.uvicorn_websocket_limits import CLOSED_FOR, SOCKET, BoundedWebSocket
from lockstep.server.robot.dial_in import DialIn
from lockstep.server.robot.pairing_offer import MAX_TRIES, OFFER_SECONDS, OfferState, Paired, Refusal
from lockstep.server.robot.waiting_robots import WaitReason
from lockstep.server.state.dependencies import Dependencies, authorized, dependencies
from lockstep.server.util.state_dir import StateDirUnusable

__all__ = ["NewPairingCode", "PairingInfo", "RobotDialInfo", "WaitingRobotInfo", "router"]

PAIRING_SECONDS = 10.0  # for a robot's whole exchange
MAX_PAIRING = 8  # robots that are in it at once
PAIRING_MESSAGES = 2  # of a robot: its hello and its proof
ROLES: dict[str, LinkRole] = {"operator": "operator", "media": "media"}
NOT_PAIRING = "no pairing code is open here: a supervisor presses “Pair a robot” on the page"
TOO_MANY_PAIR = "too many robots try to pair: wait, and try again"
GOING_AWAY, POLICY_VIOLATION = 1001, 1008  # RFC 6455 7.4.1

router = APIRouter()
Caller = Annotated[Right, Depends(authorized)]

_hello = msgspec.msgpack.Decoder(PairingHello)
_proof = msgspec.msgpack.Decoder(PairingProof)
_encode = msgspec.msgpack.Encoder().encode


class PairingInfo(msgspec.Struct, frozen=True, kw_only=True):
    """The pairing code, as everybody may know it."""

    state: OfferState
    seconds: float  # for which it is good
    tries: int  # that are left
    refused: str  # why the newest robot was refused; "" if none was


class WaitingRobotInfo(msgspec.Struct, frozen=True, kw_only=True):
    """A robot that called and was not let in. Nothing of it was checked but its address."""

    address: str
    since: float  # s since 1970
    name: str  # as it calls itself; "" if it has not said
    why: WaitReason


class RobotDialInfo(msgspec.Struct, frozen=True, kw_only=True):
    """Answer of GET /api/dial-in."""

    dials_in: bool  # false: the console connects to the robot, and the rest does not matter
    state: Literal["unpaired", "away", "connected"]
    key: Literal["", "paired", "settings"]  # where the robot's key is from
    robot: str  # the robot's own name, as it was paired
    by: str  # who paired it
    at: float  # s since 1970; 0 if it was not paired
    address: str  # where it is connected from; "" while it is away, and for all but supervisors
    detail: str  # why it is not connected
    may_pair: bool  # the caller may
    pairing: PairingInfo
    waits: list[WaitingRobotInfo]  # oldest first; empty for all but supervisors


class NewPairingCode(msgspec.Struct, frozen=True, kw_only=True):
    """Answer of POST /api/dial-in/code: the only time that the code is told."""

    code: str  # "K7-3F9QW-2MXBD"
    command: str  # for the robot's computer
    seconds: float
    tries: int


@router.get("/api/dial-in")
async def state(request: Request, caller: Caller) -> Response:
    return json_answer(_info(dependencies(request), caller))


@router.post("/api/dial-in/code")
async def open_code(request: Request, caller: Caller) -> Response:
    """Make a code that pairs one robot. It replaces the code before."""
    here = dependencies(request)
    require_role(caller, "supervisor")
    dial_in = _dial_in(here)
    if dial_in.has_given_key:
        raise NotDialIn("this robot's key is in the console's settings (link_secret_file), so it is not paired")
    if dial_in.paired is not None:
        raise AlreadyPaired(f"{dial_in.paired.robot or 'a robot'} is paired here; forget it first")
    here.request_limits.offer(caller.identity.token_id)
    code = await dial_in.open_code(caller.name)
    here.console.audit.record("pairing", caller.actor, "code", f"good for {OFFER_SECONDS:g} s")
    base = here.settings.public_url or str(request.base_url).rstrip("/")
    url = base.replace("http", "ws", 1) + str(request.scope.get("root_path", ""))
    command = f"lockstep robot NAME --console {url} --pair {code}"
    return json_answer(NewPairingCode(code=str(code), command=command, seconds=OFFER_SECONDS, tries=MAX_TRIES), 201)


@router.delete("/api/dial-in/code")
async def close_code(request: Request, caller: Caller) -> Response:
    """Close the code that is open. Idempotent."""
    here = dependencies(request)
    require_role(caller, "supervisor")
    dial_in = _dial_in(here)
    if dial_in.offer.state(time.monotonic()) == "waiting":
        here.console.audit.record("pairing", caller.actor, "code withdrawn")
    dial_in.offer.withdraw()
    return json_answer(_info(here, caller))


@router.delete("/api/dial-in/robot")
async def forget(request: Request, caller: Caller) -> Response:
    """Forget the paired robot: its links end at once, and it does not come in again."""
    here = dependencies(request)
    require_role(caller, "supervisor")
    dial_in = _dial_in(here)
    if dial_in.has_given_key:
        raise NotDialIn("this robot's key is in the console's settings (link_secret_file): change it there")
    if dial_in.paired is None and not dial_in.trouble:
        raise NotFound("no robot is paired")
    name = "" if dial_in.paired is None else dial_in.paired.robot
    here.console.audit.record("pairing", caller.actor, "forgotten", name)
    try:
        await dial_in.forget()
    except StateDirUnusable as error:
        raise StateUnavailable(f"the robot is out until this console restarts; the disk fails: {error}") from error
    return json_answer(_info(here, caller))


def _dial_in(here: Dependencies) -> DialIn:
    if here.dial_in is None:
        raise NotDialIn("this console connects to the robot; with `--robot dial-in` the robot dials in")
    return here.dial_in


def _info(here: Dependencies, caller: Right) -> RobotDialInfo:
    dial_in, now, robot = here.dial_in, time.monotonic(), here.console.robot
    supervises = caller.role == "supervisor"
    paired = None if dial_in is None else dial_in.paired
    given = dial_in is not None and dial_in.has_given_key
    known = paired is not None or given
    return RobotDialInfo(
        dials_in=dial_in is not None,
        state="connected" if robot.up else "away" if known else "unpaired",
        key="settings" if given else "paired" if paired is not None else "",
        robot="" if paired is None else paired.robot,
        by="" if paired is None else paired.by,
        at=0.0 if paired is None else round(paired.at, 3),
        address=dial_in.address if dial_in is not None and supervises else "",
        detail="" if robot.up else robot.detail,
        may_pair=supervises and dial_in is not None and not given,
        pairing=_pairing(dial_in, now),
        waits=_waits(dial_in, now) if dial_in is not None and supervises else [],
    )


def _waits(dial_in: DialIn, now: float) -> list[WaitingRobotInfo]:
    return [
        WaitingRobotInfo(address=each.address, since=round(each.since, 3), name=each.name, why=each.why)
        for each in dial_in.waits.waiting(now)
    ]


def _pairing(dial_in: DialIn | None, now: float) -> PairingInfo:
    if dial_in is None:
        return PairingInfo(state="none", seconds=0.0, tries=0, refused="")
    offer = dial_in.offer
    return PairingInfo(
        state=offer.state(now), seconds=round(offer.seconds(now), 1), tries=offer.tries, refused=offer.refused
    )


# The robot's side


@router.websocket("/dial/{name}")
async def dial(websocket: WebSocket, name: str) -> None:
    """Let the paired robot in for one link; or, for "pair", a robot that knows the code. Others get a named refusal."""
    try:
        if "origin" in websocket.headers:  # a browser's, which a page anywhere may have sent here
            raise OriginRefused("robots dial this address, and no pages")
        here = dependencies(websocket)
        dial_in = _dial_in(here)
    except ConsoleError as error:
        await _refuse(websocket, error)
        return
    try:
        if name == "pair":
            await _pair(websocket, here, dial_in)
        else:
            await _carry(websocket, here, dial_in, name)
    except ConsoleError as error:
        here.metrics.bad_input.labels("dial", http_error(error).name).inc()
        if isinstance(error, RobotUnknown):
            if here.request_limits.may_fail(websocket.scope):
                dial_in.refused(_address(websocket), "robot_unknown")
            else:
                error = TooManyRequests("too many requests without a valid token from this address")
        await _refuse(websocket, error)
    except WebSocketDisconnect as ended:
        if ended.code in CLOSED_FOR:
            here.metrics.bad_input.labels("dial", CLOSED_FOR[ended.code]).inc()
    except OSError:
        pass  # gone already
    except Exception as error:
        here.metrics.faults.caught("dial", error)  # a fault of one connection must not reach uvicorn
        await _close(websocket, GOING_AWAY)


async def _carry(websocket: WebSocket, here: Dependencies, dial_in: DialIn, name: str) -> None:
    role = ROLES.get(name)
    if role is None:
        raise NotFound("robots dial /dial/operator, /dial/media and /dial/pair")
    authorization = websocket.headers.get("authorization", "")
    if not dial_in.knows(authorization):
        raise RobotUnknown("this console does not know this robot, or has forgotten it: pair it (anew) by a code")
    socket = _socket(websocket)
    waits = ((WAIT_HEADER.encode(), WAITS.encode()),) if dial_in.is_taken(role) else ()
    await websocket.accept(headers=waits)
    if not dial_in.knows(authorization):  # the robot was forgotten meanwhile
        here.metrics.bad_input.labels("dial", "robot_unknown").inc()
        await _close(websocket, POLICY_VIOLATION)
        return
    line = _Line(socket)
    dial_in.arrived(role, line)
    try:
        while (message := await websocket.receive())["type"] != "websocket.disconnect":
            pass  # messages go to the link, past the app
        raise WebSocketDisconnect(message.get("code", GOING_AWAY))
    finally:
        line.close()


def _socket(websocket: WebSocket) -> BoundedWebSocket:
    socket = websocket.scope["extensions"].get(SOCKET)
    if not isinstance(socket, BoundedWebSocket):
        raise NotDialIn("this server takes no robots that dial in")
    return socket


class _Line:
    """A robot's WebSocket as a RobotLine."""

    def __init__(self, socket: BoundedWebSocket) -> None:
        self._socket = socket
        self.address = "" if socket.client is None else counted_address(str(socket.client[0]))

    @property
    def is_closed(self) -> bool:
        return self._socket.disconnected or self._socket.transport.is_closing()

    def carry(self, link: asyncio.Protocol) -> None:
        self._socket.carry(link)

    def close(self) -> None:
        self._socket.transport.abort()


async def _pair(websocket: WebSocket, here: Dependencies, dial_in: DialIn) -> None:
    if not here.request_limits.may_fail(websocket.scope):
        raise TooManyRequests(TOO_MANY_PAIR)
    if (ended := dial_in.offer.ended(time.monotonic())) is not None:
        dial_in.refused(_address(websocket), ended.name)
        raise NotPairing(f"{ended.name}: {ended.detail}" if ended.name != "not_pairing" else NOT_PAIRING)
    if dial_in.exchanges >= MAX_PAIRING:
        raise TooManyRequests(TOO_MANY_PAIR)
    _socket(websocket).expect(messages=PAIRING_MESSAGES, size=MAX_PAIRING_MESSAGE)
    dial_in.exchanges += 1
    try:
        await websocket.accept()
        async with asyncio.timeout(PAIRING_SECONDS):
            answer = await _exchange(websocket, here, dial_in)
        await websocket.send_bytes(_encode(answer))
        await websocket.close()
    except TimeoutError:
        here.metrics.bad_input.labels("dial", "too_slow").inc()
        await _close(websocket, POLICY_VIOLATION)
    except msgspec.MsgspecError:
        here.metrics.bad_input.labels("dial", "malformed").inc()
        await _close(websocket, POLICY_VIOLATION)
    except RuntimeError as error:  # starlette's, for a robot that is gone
        raise WebSocketDisconnect(GOING_AWAY) from error
    finally:
        dial_in.exchanges -= 1


async def _exchange(websocket: WebSocket, here: Dependencies, dial_in: DialIn) -> PairingAnswer:
    hello = _hello.decode(await _receive(websocket))
    begun = dial_in.offer.begin(hello, time.monotonic())
    if isinstance(begun, Refusal):
        return _refused(websocket, here, dial_in, hello, begun)
    exchange, challenge = begun
    await websocket.send_bytes(_encode(challenge))
    proof = _proof.decode(await _receive(websocket))
    try:
        outcome = await dial_in.prove(exchange, proof.proof)
    except StateDirUnusable as error:
        return PairingAnswer(error="state_unavailable", detail=str(error)[:500])
    if isinstance(outcome, Paired):
        by = Actor(hello.robot, "robot")
        here.console.audit.record("pairing", by, "paired", f"from {_address(websocket)}, pin {hello.pin}")
        return PairingAnswer(proof=outcome.proof)
    return _refused(websocket, here, dial_in, hello, outcome)


def _refused(
    websocket: WebSocket, here: Dependencies, dial_in: DialIn, hello: PairingHello, refusal: Refusal
) -> PairingAnswer:
    here.metrics.bad_input.labels("dial", refusal.name).inc()
    address = _address(websocket)
    here.console.audit.record("pairing", Actor("", "robot"), f"refused: {refusal.name}", f"from {address}")
    dial_in.refused(address, refusal.name, hello.robot)
    return PairingAnswer(error=refusal.name, detail=refusal.detail)


def _address(websocket: WebSocket) -> str:
    return "" if websocket.client is None else counted_address(websocket.client.host)


async def _receive(websocket: WebSocket) -> bytes:
    message = await websocket.receive()
    if message["type"] == "websocket.disconnect":
        raise WebSocketDisconnect(message.get("code", GOING_AWAY))
    data: bytes | None = message.get("bytes")
    if data is None:
        raise msgspec.DecodeError("text")  # a stranger's: pairing is binary
    if len(data) > MAX_PAIRING_MESSAGE:
        raise msgspec.DecodeError("too large")
    return data


async def _close(websocket: WebSocket, code: int) -> None:
    try:
        await websocket.close(code)
    except (RuntimeError, OSError, WebSocketDisconnect):
        return  # it is closed already


async def _refuse(websocket: WebSocket, error: ConsoleError) -> None:
    """Answer instead of opening a WebSocket, as HTTP does (RFC 9457)."""
    entry = http_error(error)
    try:
        await websocket.send_denial_response(problem_response(entry.status, entry.name, error.detail, entry.headers))
    except (RuntimeError, OSError, WebSocketDisconnect):
        return  # it was open already, or is gone
