"""Messages on the console's data channels: JSON text, the key `type` names the kind (docs/console-api.md).

They stand here and not in `server/` because the server and the headless client both speak them and neither may
import the other. JSON Schemas and the page's TypeScript types are generated from this file (scripts/generate_wire.py).

| channel | reliability | who | messages |
|---|---|---|---|
| control | unordered, 0 retransmits | client | command, rest, report, ping, trace_report, shadow |
| | | server | feedback, refusal, pong, traces, shadow_verdict |
| session | reliable | client | seat_request, seat_grant, seat_decline, seat_take, seat_release, rename, note |
| | | client | seat_offer, silence_stops, act, action_cancel, trace_request, episode_request |
| | | server | welcome, robot, seat, participants, quality, speed_cap, sources, voice, recording, note_shared |
| | | server | notice, refusal, action, status, episode, episode_answer |
| stop | reliable | client | stop, reset |
| | | server | stop_state, stop_taken, refusal |
"""

from typing import Annotated, Literal

import msgspec

from lockstep.protocol.actions import Act, ActionCancel, ActionUpdate, Status
from lockstep.protocol.carriers import Carrier
from lockstep.protocol.description import RobotDescription
from lockstep.protocol.episodes import EpisodeAnswer, EpisodeRequest, EpisodeState
from lockstep.protocol.errors import MessageError
from lockstep.protocol.maps import Navigation
from lockstep.protocol.messages import (
    Command,
    EventReference,
    Feedback,
    Ping,
    Pong,
    Refusal,
    Reset,
    Rest,
    Stop,
    StopState,
    StopTaken,
)
from lockstep.protocol.traces.trace_messages import TraceReport, TraceRequest, Traces

__all__ = [
    "PEOPLE",
    "ClientMessage",
    "DriverKind",
    "Note",
    "Notice",
    "Participant",
    "Participants",
    "Quality",
    "RecordingState",
    "Rename",
    "Report",
    "RobotState",
    "Role",
    "Seat",
    "SeatClaim",
    "SeatDecline",
    "SeatGrant",
    "SeatOffer",
    "SeatRelease",
    "SeatRequest",
    "SeatTake",
    "ServerMessage",
    "Shadow",
    "ShadowJudgement",
    "ShadowVerdict",
    "SharedNote",
    "SilenceStops",
    "SourceStatus",
    "Sources",
    "SpeedCapMode",
    "SpeedCapState",
    "StopStateNotice",
    "StreamInfo",
    "StreamOffer",
    "StreamQuality",
    "StreamReport",
    "Tier",
    "Voice",
    "Welcome",
    "decode_client_message",
    "decode_server_message",
    "driver_kind",
    "encode_console_message",
]

# "policy": a program that may drive when a person offers it the seat (docs/policies.md).
Role = Literal["operator", "observer", "supervisor", "policy"]
PEOPLE: frozenset[Role] = frozenset({"operator", "supervisor"})  # roles of people who may drive
DriverKind = Literal["none", "human", "policy"]  # of whoever drives; by the role of the link, never by a name
ShadowJudgement = Literal["in_time", "late", "unseen", "wrong_size", "not_a_number", "out_of_limits"]
SpeedCapMode = Literal["on", "off", "operator"]  # the console's setting; "operator": as the holder of the seat wants
Tier = Literal["operator", "high", "low"]  # of the encoded media: the operator's own, and the observers' two
Name = Annotated[str, msgspec.Meta(max_length=60)]
Count = Annotated[int, msgspec.Meta(ge=0, le=2**53 - 1)]  # a JavaScript number holds these exactly
Difference = Annotated[int, msgspec.Meta(ge=-(2**53 - 1), le=2**53 - 1)]
Milliseconds = Annotated[float, msgspec.Meta(ge=-1e9, le=1e9)]
MAX_STREAMS = 32
MAX_SHADOW_VALUES = 64  # axes


class StreamReport(msgspec.Struct, frozen=True, kw_only=True):
    """How one stream does at a client, since it connected."""

    stream: Name
    carrier: Carrier
    stamp: Count = 0  # last one seen; 0 before the first
    gap: Difference = 0  # at the last rendering
    max_gap: Difference = 0  # largest |gap| rendered
    rendered: Count = 0
    discarded: Count = 0
    held: Count = 0
    tolerance: Count = 0  # events; the tolerance of the person at the client
    lag: Difference = 0  # largest feedback - stamp among what arrived since the last report, rendered or not
    violations: Count = 0  # rendered with |gap| > tolerance: 0 unless the gate is off or goes by age
    gate: Literal["event", "off"] = "event"  # how it is gated now


class Report(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="report"):
    """A client's statistics, a few times a second; also its heartbeat for the control seat."""

    event: Count = 0  # newest feedback; 0 before the first
    armed: bool = False
    streams: Annotated[list[StreamReport], msgspec.Meta(max_length=MAX_STREAMS)] = []
    picture_delay_ms: Milliseconds | None = None  # command to picture, on the client's own clock; None: not known now
    round_trip_ms: Milliseconds | None = None
    speed_cap: bool = False  # whether the operator wants the speed capped by the delay
    ping: Difference | None = None  # id of a ping that travels with it; answered as a ping is


class SeatRequest(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="seat_request"):
    """Ask for the control seat; answered by `seat` to all, or by a refusal.

    While another peer holds it the request is put to that peer, unless `only_if_free`: then it is refused.
    """

    only_if_free: bool = False


class SeatGrant(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="seat_grant"):
    """The holder hands the seat to a peer that asked for it."""

    peer: Name


class SeatDecline(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="seat_decline"):
    """The holder refuses a peer that asked for the seat."""

    peer: Name


class SeatTake(msgspec.Struct, frozen=True, tag_field="type", tag="seat_take"):
    """Take the seat at once: a supervisor from any holder, an operator from a policy or when it is free."""


class SeatOffer(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="seat_offer"):
    """An operator or supervisor lets a policy drive, or no longer does; the seat's holder frees it by that.

    Without an offer no policy gets the seat, and the end of the offer ends the policy's turn.
    """

    offered: bool = True  # False: withdraw the offer, which rests the robot if a policy drives
    peer: Name = ""  # the only policy that may take the seat; "": any


class Shadow(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="shadow"):
    """The command that a policy would send, if it drove. It is judged and recorded, and never reaches the robot."""

    event: EventReference  # the one that it would become
    issue: Annotated[int, msgspec.Meta(ge=1)]  # of the feedback that it answers
    nonce: Annotated[int, msgspec.Meta(ge=0, le=2**53 - 1)] = 0  # of that feedback
    values: Annotated[list[float | None], msgspec.Meta(max_length=MAX_SHADOW_VALUES)]  # as in a command


class SeatRelease(msgspec.Struct, frozen=True, tag_field="type", tag="seat_release"):
    """Give the control seat back."""


class SilenceStops(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="silence_stops"):
    """A supervisor silences the link of a peer that keeps pressing STOP, or lets it press again."""

    peer: Name
    silent: bool = True


class Rename(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="rename"):
    """The name that others see."""

    name: Name


class Note(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="note"):
    """Text to everyone."""

    text: Annotated[str, msgspec.Meta(min_length=1, max_length=500)]


class StreamInfo(msgspec.Struct, frozen=True, kw_only=True):
    """One negotiated medium."""

    mid: str  # the media section of the answer
    stream: str  # name of the camera or microphone
    label: str
    kind: Literal["video", "audio"]
    codec: str  # "H264", "VP8", "opus", "PCMU"
    carrier: Carrier


class StreamOffer(msgspec.Struct, frozen=True, kw_only=True):
    """A medium that a peer can ask for: the i-th of a kind is for the offer's i-th section of that kind."""

    stream: str
    label: str
    kind: Literal["video", "audio"]


class Welcome(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="welcome"):
    """First message on `session`."""

    peer: str  # this connection's id
    role: Role
    name: str
    streams: list[StreamInfo]
    voice: str = ""  # the media section in which this peer's voice is taken; "" when it is not


class RobotState(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="robot"):
    """State of the robot link. A new epoch always comes with a new connection: the server closes the old one."""

    link: Literal["up", "down"]
    epoch: str
    description: RobotDescription
    detail: str = ""  # why it is down


class SeatClaim(msgspec.Struct, frozen=True, kw_only=True):
    """A request for the seat that its holder has not answered yet."""

    peer: str
    name: str
    seconds_left: float  # then it counts as declined


class Seat(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="seat"):
    """Who may drive. `holder` is a peer id, empty when the seat is free."""

    holder: str = ""  # the peer's id
    name: str = ""  # the holder's
    why: str = ""  # of the last change: "released", "heartbeat lost", "disconnected", "granted", "taken", "idle" …
    kind: DriverKind = "none"  # of the holder
    claims: list[SeatClaim] = []  # the one that waits longest first
    offered: bool = False  # to policies; stays while one drives, and its turn ends with the offer
    offered_to: str = ""  # the only policy that may take it, a peer id; "": any
    offered_by: str = ""  # name of the person who did
    idle_seconds_left: float | None = None  # until the idle holder loses it; sent when the countdown begins or ends


class Participant(msgspec.Struct, frozen=True, kw_only=True):
    """A connected peer, as all others see it."""

    peer: str  # its id, as in `Seat.holder`
    name: str  # as the peer calls itself
    role: Role  # of its link
    carrier: Carrier  # the way in which stamps travel to it
    gap: int = 0  # of the picture on its screen, in events
    picture_delay_ms: float | None = None  # from a command to its picture; None: unknown
    round_trip_ms: float | None = None  # to the console; None: not measured yet
    loss: float | None = None  # 0 to 1, of the media on the way to this peer
    tier: Tier | None = None  # None: receives no video
    silenced: bool = False  # a supervisor silenced the stops of its link


class StreamQuality(msgspec.Struct, frozen=True, kw_only=True):
    """How one camera's pictures are encoded for this peer now."""

    stream: str
    tier: Tier
    width: int  # pixels
    height: int
    frames_per_second: float
    bits_per_second: float  # the encoder's target
    camera_frames_per_second: float = 0.0  # of which those are some or all; 0: not known


class Quality(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="quality"):
    """What the quality controller decided for this peer's pictures, and why; sent when it changes."""

    streams: list[StreamQuality]
    reason: str = ""  # "loss", "gap", "bandwidth", "round trip", "" when nothing limits
    crowd: int = 0  # more than so many watch, so that each gets fewer pictures; 0: no crowd


class SpeedCapState(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="speed_cap"):
    """Whether and how far the console caps the speed for the delay; sent to newcomers and when it changes."""

    mode: SpeedCapMode
    holds: bool = False  # whether the cap is in force
    share: float = 1.0  # of each axis' full speed that may be used
    delay_ms: float | None = None  # that it goes by; None: not known, or the cap is not in force
    why: Literal["", "delay", "unknown"] = ""  # why the share is below 1


class SourceStatus(msgspec.Struct, frozen=True, kw_only=True):
    """A camera or microphone that is attached to the console itself."""

    stream: str
    label: str
    state: Literal["waiting", "connecting", "live", "reconnecting"]  # waiting: for a publisher
    detail: str = ""  # why it is not live; for a published one, its publisher


class Sources(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="sources"):
    """How they all do; sent to newcomers and on every change. Without any it is never sent."""

    sources: list[SourceStatus]


class Voice(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="voice"):
    """Who is heard at the robot now; sent to everyone when it changes."""

    peer: str = ""  # "" when no peer speaks
    name: str = ""
    trouble: str = ""  # why no voice can be heard now, as when the loudspeaker does not work


class RecordingState(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="recording"):
    """Whether the session is recorded; sent to newcomers, when it changes, and every few seconds while it is."""

    state: Literal["off", "recording", "failed"]
    id: str = ""  # of the file that is written now; "" before the robot was reached
    recording: str = ""  # common to all its files
    name: str = ""  # that a person gave it
    by: str = ""  # the person who started it; "" for none
    since: float = 0.0  # s since 1970
    bytes: Count = 0
    lost: Count = 0  # records that were left out because the disk was too slow
    detail: str = ""  # why it failed, or the reason to wait


class SharedNote(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="note_shared"):
    """A participant's note, with the event it belongs to. Newcomers get the last ones."""

    id: int  # counts up in a session
    peer: str  # the id of the peer that wrote it
    name: str  # the writer's
    role: Role  # the writer's
    text: str  # at most 500 characters
    epoch: str  # of the event; "" before the robot was reached
    event: EventReference  # the one that held
    time: float  # s since 1970, the console's clock: for people to read, never for a decision


class ShadowVerdict(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="shadow_verdict"):
    """What a shadow policy wanted for an event, beside what was done; the newest ones, a few times a second."""

    peer: str  # the policy's
    name: str
    event: EventReference
    values: list[float | None]  # as the policy sent them
    judgement: ShadowJudgement
    difference: float | None = None  # 0: the same as was done; 1: one axis apart by all its range; None: not compared


class Participants(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="participants"):
    participants: list[Participant]


class StopStateNotice(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="stop_state"):
    """The robot's stop state, as the bridge reports it; sent on every change and to newcomers."""

    stop: StopState
    event: EventReference


class Notice(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="notice"):
    """Something a person should read."""

    level: Literal["info", "warning", "error"]
    text: str


ClientMessage = (
    Command
    | Rest
    | Report
    | Ping
    | SeatRequest
    | SeatGrant
    | SeatDecline
    | SeatTake
    | SeatOffer
    | SeatRelease
    | SilenceStops
    | Rename
    | Note
    | Act
    | ActionCancel
    | EpisodeRequest
    | Stop
    | Reset
    | TraceRequest
    | TraceReport
    | Shadow
)
ServerMessage = (
    Feedback
    | Refusal
    | Pong
    | Welcome
    | RobotState
    | Seat
    | Participants
    | Quality
    | SpeedCapState
    | Sources
    | Voice
    | RecordingState
    | SharedNote
    | Notice
    | StopStateNotice
    | StopTaken
    | ActionUpdate
    | EpisodeState
    | EpisodeAnswer
    | Status
    | Navigation
    | Traces
    | ShadowVerdict
)

_client_decoder: msgspec.json.Decoder[ClientMessage] = msgspec.json.Decoder(ClientMessage)
_server_decoder: msgspec.json.Decoder[ServerMessage] = msgspec.json.Decoder(ServerMessage)
_encoder = msgspec.json.Encoder()


def driver_kind(role: str) -> DriverKind:
    """Return the kind of a driver whose link has this role; "": nobody."""
    return "policy" if role == "policy" else "human" if role else "none"


def encode_console_message(message: ClientMessage | ServerMessage) -> str:
    return _encoder.encode(message).decode()


def decode_client_message(text: str | bytes) -> ClientMessage:
    """What a client sent.

    Raises:
        MessageError: not JSON, an unknown kind, or a field of the wrong type or range.
    """
    try:
        return _client_decoder.decode(text)
    except (msgspec.DecodeError, UnicodeError, RecursionError) as error:
        raise MessageError(str(error)) from error


def decode_server_message(text: str | bytes) -> ServerMessage:
    """What the server sent; raises as `decode_client_message`."""
    try:
        return _server_decoder.decode(text)
    except (msgspec.DecodeError, UnicodeError, RecursionError) as error:
        raise MessageError(str(error)) from error
