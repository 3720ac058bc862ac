"""The OpenAPI document of the console's HTTP interface: one table of operations. No I/O.

FastAPI could document neither bodies nor answers: bodies are read with bounds, and answers are msgspec structs.
"""

import json
import re
from collections.abc import Sequence
from http import HTTPStatus
from typing import Any, NamedTuple, get_args

import msgspec

from lockstep.protocol.actions import ActionUpdate
from lockstep.protocol.console import RecordingState, Seat
from lockstep.protocol.episodes import EpisodeState, EpisodeVerb
from lockstep.protocol.serial import MAX_EVENT
from lockstep.server.errors import (
    HTTP_ERRORS,
    ActionIdUsed,
    AlreadyPaired,
    AlreadyPublishing,
    AlreadyRecording,
    BadJson,
    BadParameter,
    BadSdp,
    BadSdpFragment,
    BodyTooLarge,
    BodyTooSlow,
    CameraTaken,
    ConsoleError,
    EditRefused,
    EpisodeEmpty,
    EpisodeOpen,
    HostRefused,
    HttpError,
    LinkExpired,
    LinkOtherRobot,
    LinkRevoked,
    LockedOut,
    NoEpisode,
    NoSeat,
    NotAcceptable,
    NotAllowed,
    NoTask,
    NotConnected,
    NotDialIn,
    NotFound,
    NotRenewable,
    OriginRefused,
    OtherEpisode,
    PreconditionFailed,
    PreconditionRequired,
    PressUsed,
    RecordingFailed,
    RecordingOff,
    RecordingUnreadable,
    ResetNotKept,
    ResetTooSoon,
    RobotLinkDown,
    RobotUnreachable,
    SceneUnavailable,
    ShuttingDown,
    Silenced,
    StaleEdit,
    StaleReset,
    StateUnavailable,
    TokenInvalid,
    TokenMissing,
    TooFewSections,
    TooManyInvitations,
    TooManyPeers,
    TooManyRequests,
    Unconfirmed,
    WrongMediaType,
)
from lockstep.server.http.problem import PROBLEM_JSON, Problem
from lockstep.server.recording.episodes.episode_list import RecordingEpisodes
from lockstep.server.routes.access import MAX_RECORDS, AuditPage, InvitationList, InvitationRequest, NewInvitation
from lockstep.server.routes.actions import ActionList, ActionRequest, RobotStatus
from lockstep.server.routes.dial_in import NewPairingCode, RobotDialInfo
from lockstep.server.routes.episodes import EpisodeBody
from lockstep.server.routes.maps import NewestMap
from lockstep.server.routes.observer_websocket import WatchTicket
from lockstep.server.routes.recorded.recorded_episodes import EpisodeChangeBody, EpisodeList
from lockstep.server.routes.recorded.recordings import (
    MAX_LISTED,
    FileTicket,
    RecordingDetails,
    RecordingList,
    RecordingRequest,
)
from lockstep.server.routes.seat import OfferRequest
from lockstep.server.routes.session import (
    Delivered,
    Health,
    Readiness,
    Released,
    ResetRequest,
    ScenePath,
    SessionInfo,
)
from lockstep.server.routes.stop_body import StopRequest
from lockstep.server.sfu.tickets import RelayAnswer
from lockstep.server.webrtc.ice_servers import IceServers

__all__ = ["OPERATIONS", "Operation", "openapi_document"]

SDP = "application/sdp"
FRAGMENT = "application/trickle-ice-sdpfrag"
JSON = "application/json"
OCTETS = "application/octet-stream"
MCAP = "application/x-mcap"
JPEG = "image/jpeg"
HTML = "text/html"

Errors = tuple[type[ConsoleError], ...]

EVERYWHERE: Errors = (HostRefused, TooManyRequests)
WITH_TOKEN: Errors = (TokenMissing, TokenInvalid, LinkExpired, LinkRevoked, LinkOtherRobot)
WITH_BODY: Errors = (BodyTooLarge, BodyTooSlow)
WITH_JSON: Errors = (BadJson, *WITH_BODY)


class Parameter(NamedTuple):
    name: str
    where: str  # "path", "query", "header"
    schema: dict[str, Any]
    required: bool = False


class Operation(NamedTuple):
    """One method of one path."""

    method: str
    path: str
    summary: str
    status: int  # on success
    answer: type[msgspec.Struct] | str | None  # a struct as JSON, text of a media type, nothing
    errors: Errors = ()
    body: type[msgspec.Struct] | str | None = None
    token: bool = True
    parameters: tuple[Parameter, ...] = ()
    headers: tuple[str, ...] = ()  # of the answer, besides those of every answer
    also: tuple[int, ...] = ()  # other statuses that are no errors; without a body


RESOURCE = Parameter("resource", "path", {"type": "string"}, required=True)
MATCH = Parameter("If-Match", "header", {"type": "string", "pattern": r'^(\*|"[0-9a-f]{16}")$'}, required=True)
STAMP = Parameter("stamp", "query", {"type": "string", "enum": ["trailer"]})
RELAY = Parameter("relay", "query", {"type": "string", "pattern": r"^\d{0,3}$"})
WATCHED = Parameter("relay", "query", {"type": "string", "pattern": r"^\d{1,3}$"}, required=True)
WATCH_TICKET = Parameter("ticket", "path", {"type": "string"}, required=True)
CAMERA = Parameter("camera", "query", {"type": "string", "maxLength": 32})
VIEW = Parameter("view", "query", {"type": "string", "enum": ["thumbnail"]})
SECTIONS = Parameter("sections", "query", {"type": "string", "enum": ["all"]})
PEER = Parameter("peer", "query", {"type": "string", "maxLength": 16})
LOST = Parameter("lost", "query", {"type": "string", "maxLength": 40})
AFTER = Parameter("after", "query", {"type": "integer", "default": 0})
BEFORE = Parameter("before", "query", {"type": "integer", "minimum": 0, "default": 0})
LIMIT = Parameter("limit", "query", {"type": "integer", "minimum": 1, "maximum": MAX_RECORDS, "default": 100})
LISTED = Parameter("limit", "query", {"type": "integer", "minimum": 1, "maximum": MAX_LISTED, "default": MAX_LISTED})
RECORDING = Parameter("recording_id", "path", {"type": "string"}, required=True)
CHUNK = Parameter("number", "path", {"type": "integer"}, required=True)
AFTER_CHUNK = Parameter("after", "query", {"type": "integer", "minimum": 0, "default": 0})
FROM = Parameter("from", "query", {"type": "integer", "minimum": 1, "maximum": MAX_EVENT}, required=True)
TO = Parameter("to", "query", {"type": "integer", "minimum": 1, "maximum": MAX_EVENT}, required=True)
TOPIC = Parameter("topic", "query", {"type": "array", "items": {"type": "string"}, "maxItems": 50})
DECODABLE = Parameter("decodable", "query", {"type": "boolean", "default": False})
EVENT = Parameter("event", "query", {"type": "integer", "minimum": 1, "maximum": MAX_EVENT}, required=True)
PICTURE_CAMERA = Parameter("camera", "query", {"type": "string", "minLength": 1, "maxLength": 80}, required=True)
WIDTH = Parameter("width", "query", {"enum": [160, 320, 640], "default": 160})
SKIP = Parameter("skip", "query", {"type": "integer", "minimum": 0, "maximum": 1_000_000, "default": 0})
KNOWN = Parameter("known", "query", {"type": "string", "maxLength": 64})
TICKET = Parameter("ticket", "query", {"type": "string"})
EPISODE_VERB = Parameter("do", "path", {"enum": list(get_args(EpisodeVerb))}, required=True)
ACTION = Parameter("action", "path", {"type": "string"}, required=True)
INVITATION = Parameter("invitation_id", "path", {"type": "string"}, required=True)

OPERATIONS: tuple[Operation, ...] = (
    Operation(
        *("post", "/whep", "Offer a WebRTC connection (WHEP).", 201, SDP),
        errors=(
            BadSdp,
            TooFewSections,
            WrongMediaType,
            BadParameter,
            RobotUnreachable,
            TooManyPeers,
            ShuttingDown,
            *WITH_BODY,
        ),
        body=SDP,
        parameters=(STAMP, RELAY, VIEW, SECTIONS),
        headers=("Location", "ETag", "Accept-Patch"),
    ),
    Operation(
        *("patch", "/whep/{resource}", "More ICE candidates, or an ICE restart (If-Match: *).", 200, FRAGMENT),
        errors=(
            *(BadSdpFragment, WrongMediaType, NotFound, NotConnected, PreconditionFailed, PreconditionRequired),
            *WITH_BODY,
        ),
        body=FRAGMENT,
        parameters=(RESOURCE, MATCH),
        headers=("ETag",),
        also=(204,),
    ),
    Operation("delete", "/whep/{resource}", "End a connection.", 200, None, (NotFound,), parameters=(RESOURCE,)),
    Operation(
        *("post", "/whip", "Publish a camera (WHIP).", 201, SDP),
        errors=(
            BadSdp,
            NotAcceptable,
            NotAllowed,
            NotFound,
            WrongMediaType,
            BadParameter,
            RobotUnreachable,
            AlreadyPublishing,
            CameraTaken,
            ShuttingDown,
            *WITH_BODY,
        ),
        body=SDP,
        parameters=(CAMERA,),
        headers=("Location", "ETag", "Accept-Patch"),
    ),
    Operation(
        *("patch", "/whip/{resource}", "More ICE candidates, or an ICE restart (If-Match: *).", 200, FRAGMENT),
        errors=(
            *(BadSdpFragment, WrongMediaType, NotFound, NotConnected, PreconditionFailed, PreconditionRequired),
            *WITH_BODY,
        ),
        body=FRAGMENT,
        parameters=(RESOURCE, MATCH),
        headers=("ETag",),
        also=(204,),
    ),
    Operation("delete", "/whip/{resource}", "End a publication.", 200, None, (NotFound,), parameters=(RESOURCE,)),
    Operation("get", "/api/session", "The state of the session.", 200, SessionInfo),
    Operation("get", "/api/ice", "STUN and TURN servers, with credentials for a while.", 200, IceServers),
    Operation(
        *("get", "/api/relay", "The relay of an observer's media; null: the console sends them.", 200, RelayAnswer),
        errors=(BadParameter,),
        parameters=(PEER, LOST),
    ),
    Operation(
        *("post", "/api/watch", "A ticket for the WebSocket of an observer behind a relay.", 201, WatchTicket),
        errors=(NotAllowed, NotFound, BadParameter, RobotUnreachable, TooManyPeers, ShuttingDown),
        parameters=(WATCHED,),
    ),
    Operation(
        *("delete", "/watch/{ticket}", "Return a ticket.", 200, None, (NotFound,)),
        parameters=(WATCH_TICKET,),
    ),
    Operation(
        *("post", "/api/stop", "Stop the robot, latched. Every role may do this.", 200, Delivered),
        errors=(Silenced, PressUsed, RobotLinkDown, Unconfirmed, *WITH_JSON),
        body=StopRequest,
    ),
    Operation(
        *("post", "/api/reset", "Release the latched stop that the body names.", 200, Released),
        errors=(
            *(NotAllowed, NoSeat, StaleReset, ResetTooSoon, LockedOut, RobotLinkDown, Unconfirmed, ResetNotKept),
            *WITH_JSON,
        ),
        body=ResetRequest,
    ),
    Operation("get", "/api/seat", "Who may drive.", 200, Seat),
    Operation("post", "/api/seat/take_over", "Take the robot from the policy that drives.", 200, Seat, (NotAllowed,)),
    Operation(
        *("post", "/api/seat/offer", "Let a policy drive, or no longer.", 200, Seat),
        (BadJson, BodyTooLarge, BodyTooSlow, WrongMediaType, NotAllowed, NoSeat, TooManyRequests, RobotLinkDown),
        body=OfferRequest,
    ),
    Operation("get", "/api/actions", "How the newest actions of the robot do.", 200, ActionList),
    Operation(
        *("post", "/api/actions/{action}", "Ask for an action, by name, that moves nothing.", 200, ActionUpdate),
        errors=(NotAllowed, NoSeat, NotFound, NotRenewable, ActionIdUsed, RobotLinkDown, Unconfirmed, *WITH_JSON),
        body=ActionRequest,
        parameters=(ACTION,),
    ),
    Operation(
        *("delete", "/api/actions/{action}", "Cancel an action, by the id of its request.", 200, ActionUpdate),
        errors=(NotAllowed, NoSeat, NotFound, RobotLinkDown, Unconfirmed),
        parameters=(ACTION,),
    ),
    Operation("get", "/api/episode", "How the episode does.", 200, EpisodeState),
    Operation(
        *("post", "/api/episode/{do}", "Begin, keep, discard, redo or mark an episode.", 200, EpisodeState),
        errors=(
            NotAllowed,
            RecordingOff,
            EpisodeOpen,
            NoEpisode,
            OtherEpisode,
            EpisodeEmpty,
            NoTask,
            BadParameter,
            RobotLinkDown,
            RecordingFailed,
            *WITH_JSON,
        ),
        body=EpisodeBody,
        parameters=(EPISODE_VERB,),
    ),
    Operation("get", "/api/status", "What the robot says of itself.", 200, RobotStatus),
    Operation("get", "/api/map", "The robot's newest map.", 200, NewestMap, (NotFound,)),
    Operation("post", "/api/scene", "A ticket for the 3D scene.", 200, ScenePath, (SceneUnavailable,)),
    Operation("get", "/api/dial-in", "How the robot that dials in is paired, and its state.", 200, RobotDialInfo),
    Operation(
        *("post", "/api/dial-in/code", "Make a code that pairs one robot.", 201, NewPairingCode),
        errors=(NotAllowed, NotDialIn, AlreadyPaired),
    ),
    Operation(
        *("delete", "/api/dial-in/code", "Withdraw the pairing code.", 200, RobotDialInfo),
        errors=(NotAllowed, NotDialIn),
    ),
    Operation(
        *("delete", "/api/dial-in/robot", "Forget the paired robot and end its links.", 200, RobotDialInfo),
        errors=(NotAllowed, NotDialIn, NotFound, StateUnavailable),
    ),
    Operation("get", "/api/invitations", "The links that the caller may see.", 200, InvitationList, (NotAllowed,)),
    Operation(
        *("post", "/api/invitations", "Invite a person.", 201, NewInvitation),
        errors=(NotAllowed, BadParameter, TooManyInvitations, StateUnavailable, *WITH_JSON),
        body=InvitationRequest,
    ),
    Operation(
        *("delete", "/api/invitations/{invitation_id}", "Revoke a link and end its connections.", 200, InvitationList),
        errors=(NotAllowed, NotFound, StateUnavailable),
        parameters=(INVITATION,),
    ),
    Operation(
        *("get", "/api/audit", "The audit trail.", 200, AuditPage),
        errors=(NotAllowed, BadParameter),
        parameters=(AFTER, BEFORE, LIMIT),
    ),
    Operation(
        *("get", "/api/recordings", "The state of the recording, and all recordings.", 200, RecordingList),
        errors=(BadParameter, RecordingUnreadable, RecordingFailed),
        parameters=(BEFORE, LISTED),
    ),
    Operation(
        *("post", "/api/recordings", "Start a recording.", 201, RecordingState),
        errors=(NotAllowed, AlreadyRecording, TooManyRequests, RecordingFailed, *WITH_JSON),
        body=RecordingRequest,
    ),
    Operation("post", "/api/recordings/stop", "End the recording.", 200, RecordingState, (NotAllowed,)),
    Operation(
        *("get", "/api/recordings/{recording_id}", "One recording with its index.", 200, RecordingDetails),
        errors=(NotFound, BadParameter, RecordingUnreadable, RecordingFailed),
        parameters=(RECORDING, AFTER_CHUNK),
    ),
    Operation(
        *("get", "/api/episodes", "The episodes of all recordings, with the changes to them.", 200, EpisodeList),
        errors=(BadParameter, RecordingFailed),
        parameters=(SKIP, KNOWN),
    ),
    Operation(
        *("get", "/api/recordings/{recording_id}/episodes", "The episodes of a recording.", 200, RecordingEpisodes),
        errors=(NotFound, NotAllowed, RecordingUnreadable, RecordingFailed),
        parameters=(RECORDING,),
    ),
    Operation(
        *("post", "/api/recordings/{recording_id}/episodes", "Change an episode.", 200, RecordingEpisodes),
        errors=(NotFound, NotAllowed, StaleEdit, EditRefused, RecordingUnreadable, RecordingFailed, *WITH_JSON),
        body=EpisodeChangeBody,
        parameters=(RECORDING,),
    ),
    Operation(
        *("get", "/api/recordings/{recording_id}/picture", "The picture of an event.", 200, JPEG),
        errors=(NotFound, NotAllowed, BadParameter, RecordingUnreadable, RecordingFailed),
        parameters=(RECORDING, EVENT, PICTURE_CAMERA, WIDTH),
        headers=("Lockstep-Event",),
    ),
    Operation(
        *("get", "/api/recordings/{recording_id}/report", "A report of the recording, as a page.", 200, HTML),
        errors=(NotFound, NotAllowed, AlreadyRecording, BadParameter, RecordingUnreadable, RecordingFailed),
        parameters=(RECORDING,),
        headers=("Content-Disposition",),
    ),
    Operation(
        *("get", "/api/recordings/{recording_id}/chunks/{number}", "The records of a chunk.", 200, OCTETS),
        errors=(NotFound, BadParameter, RecordingUnreadable, RecordingFailed),
        parameters=(RECORDING, CHUNK),
    ),
    Operation(
        *("get", "/api/recordings/{recording_id}/records", "The records of a range of events.", 200, OCTETS),
        errors=(NotFound, BadParameter, RecordingUnreadable, RecordingFailed),
        parameters=(RECORDING, FROM, TO, TOPIC, DECODABLE),
    ),
    Operation(
        *("post", "/api/recordings/{recording_id}/ticket", "A path to download it from.", 200, FileTicket),
        errors=(NotAllowed, NotFound, RecordingUnreadable, RecordingFailed),
        parameters=(RECORDING,),
    ),
    Operation(
        *("get", "/api/recordings/{recording_id}/file", "The file; with Range.", 200, MCAP),
        errors=(NotAllowed, NotFound, RecordingUnreadable, RecordingFailed),
        parameters=(RECORDING, TICKET),
        also=(206, 416),
    ),
    Operation(
        *("delete", "/api/recordings/{recording_id}", "Delete the file.", 200, RecordingList),
        errors=(NotAllowed, NotFound, AlreadyRecording, RecordingFailed),
        parameters=(RECORDING,),
    ),
    Operation("get", "/healthz", "Whether the console runs, and reaches its robot.", 200, Health, token=False),
    Operation("get", "/readyz", "Whether the console serves.", 200, Readiness, token=False, also=(503,)),
    Operation("get", "/metrics", "Prometheus.", 200, "text/plain", token=False),
)


def openapi_document(operations: Sequence[Operation] = OPERATIONS) -> dict[str, Any]:
    """Return the OpenAPI 3.1 document, in JSON's types alone."""
    structs = {Problem} | {kind for each in operations for kind in (each.answer, each.body) if isinstance(kind, type)}
    ordered = sorted(structs, key=lambda struct: struct.__name__)
    _, components = msgspec.json.schema_components(ordered, ref_template="#/components/schemas/{name}")
    paths: dict[str, dict[str, Any]] = {}
    for operation in operations:
        paths.setdefault(operation.path, {})[operation.method] = _operation(operation)
    document = {
        "openapi": "3.1.0",
        "info": {"title": "Lockstep console", "version": "1", "description": "See docs/console-api.md."},
        "paths": paths,
        "components": {
            "schemas": dict(sorted(components.items())),
            "securitySchemes": {"token": {"type": "http", "scheme": "bearer"}},
        },
    }
    found: dict[str, Any] = json.loads(msgspec.json.encode(document))
    return found


def _operation(operation: Operation) -> dict[str, Any]:
    found: dict[str, Any] = {
        "operationId": operation_id(operation),
        "tags": [_tag(operation.path)],
        "summary": operation.summary,
        "responses": _responses(operation),
    }
    if operation.token:
        found["security"] = [{"token": []}]
    if operation.parameters:
        found["parameters"] = [
            {"name": each.name, "in": each.where, "required": each.required, "schema": each.schema}
            for each in operation.parameters
        ]
    if operation.body is not None:
        found["requestBody"] = {"required": isinstance(operation.body, str), "content": _content(operation.body)}
    return found


def operation_id(operation: Operation) -> str:
    """Return the id for generated clients: the method and the words of the path, `post_api_stop`."""
    words = [re.sub(r"\W+", "_", each).strip("_") for each in operation.path.split("/")]
    return "_".join([operation.method, *filter(None, words)])


def _tag(path: str) -> str:
    """Return the group of an operation in the documentation: "recordings" of /api/recordings/{id}."""
    words = [each for each in path.split("/") if each and not each.startswith("{") and each != "api"]
    return words[0] if words else "console"


def _responses(operation: Operation) -> dict[str, Any]:
    good: dict[str, Any] = {"description": HTTPStatus(operation.status).phrase}
    if operation.answer is not None:
        good["content"] = _content(operation.answer)
    if operation.headers:
        good["headers"] = {name: {"required": True, "schema": {"type": "string"}} for name in operation.headers}
    responses = {str(operation.status): good}
    responses |= {str(status): {"description": HTTPStatus(status).phrase} for status in operation.also}
    for status, entries in sorted(_errors(operation).items()):
        responses[str(status)] = _error(status, entries)
    return responses


def _errors(operation: Operation) -> dict[int, list[HttpError]]:
    """Return the errors by status: those of this operation, and those of all operations."""
    errors = (*operation.errors, *EVERYWHERE, *(WITH_TOKEN if operation.token else ()))
    if operation.method != "get":
        errors += (OriginRefused,)
    by_status: dict[int, list[HttpError]] = {}
    for error in errors:
        entry = HTTP_ERRORS[error]
        known = by_status.setdefault(entry.status, [])
        if entry.name not in [each.name for each in known]:
            known.append(entry)
    return by_status


def _error(status: int, entries: list[HttpError]) -> dict[str, Any]:
    names = sorted(entry.name for entry in entries)
    schema = {"allOf": [_reference(Problem), {"properties": {"error": {"enum": names}}}]}
    always = set.intersection(*({*entry.headers} for entry in entries)) - {"Connection"}
    found: dict[str, Any] = {"description": ", ".join(names), "content": {PROBLEM_JSON: {"schema": schema}}}
    if always:
        found["headers"] = {name: {"required": True, "schema": {"type": "string"}} for name in sorted(always)}
    return found


def _content(kind: type[msgspec.Struct] | str) -> dict[str, Any]:
    if isinstance(kind, str):
        return {kind: {"schema": {"type": "string"}}}
    return {JSON: {"schema": _reference(kind)}}


def _reference(struct: type[msgspec.Struct]) -> dict[str, str]:
    return {"$ref": f"#/components/schemas/{struct.__name__}"}
