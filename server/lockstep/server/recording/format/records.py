"""Lockstep's own records in a recording: JSON, with a published JSON Schema for each kind.

The JSON Schemas are generated from this file (scripts/generate_wire.py). Pictures, sound, joints and so on have
Foxglove's schemas; see `lockstep.server.recording.format.topics`.
"""

from typing import Annotated, Literal

import msgspec

from lockstep.protocol.actions import ActionReason, ActionState, ParameterValue, StatusItem
from lockstep.protocol.console import DriverKind, Participant, Report, ShadowJudgement
from lockstep.protocol.description import RobotDescription
from lockstep.protocol.episodes import EpisodeOutcome
from lockstep.protocol.maps import Coordinate, MapId, OccupancyMap, PlanarPose
from lockstep.protocol.messages import EventReference, RefusalReason, StopState
from lockstep.protocol.traces.trace import CommandSpans, PictureSpans

__all__ = [
    "OWN_RECORDS",
    "ActionRecord",
    "CommandOutcome",
    "CommandRecord",
    "Degraded",
    "EpisodeRecord",
    "FeedbackRecord",
    "MapRecord",
    "NavigationRecord",
    "NoteRecord",
    "OwnRecord",
    "ParticipantsRecord",
    "RefusalRecord",
    "ReportRecord",
    "RestRecord",
    "RobotRecord",
    "SeatRecord",
    "ShadowRecord",
    "SignatureRecord",
    "StatusRecord",
    "StopRecord",
    "TraceRecord",
    "Vector",
    "Whole",
    "WrenchRecord",
]

Count = Annotated[int, msgspec.Meta(ge=0)]
Whole = Annotated[int, msgspec.Meta(ge=0, le=2**53 - 1)]  # integers that a JavaScript number holds exactly

# The outcome of a command at the console. Only a forwarded one reached the robot bridge.
CommandOutcome = Literal["forwarded", "repeated", "refused", "undelivered"]


class OwnRecord(msgspec.Struct, frozen=True, kw_only=True):
    """What all of them have."""

    epoch: str  # run of the robot bridge; references of different epochs are never compared
    event: EventReference


class RobotRecord(OwnRecord, frozen=True, kw_only=True):
    """The robot link, at the start of every file and whenever it changes."""

    link: Literal["up", "down"]
    detail: str = ""  # why it is down
    description: RobotDescription


class CommandRecord(OwnRecord, frozen=True, kw_only=True):
    """A command that somebody sent; `event` is the one that it is to become."""

    issue: Annotated[int, msgspec.Meta(ge=1)]  # of the feedback that it answers
    values: list[float | None]  # one per axis, in its unit; as forwarded, else as asked; null: a goal axis stays
    peer: str
    name: str
    outcome: CommandOutcome
    reason: RefusalReason | Literal[""] = ""  # why it was refused
    nonce: int = 0  # as its sender named it; 0 in recordings from before there were nonces
    action: str = ""  # id of the moving action that it lets go on
    speed: float = 1.0  # of the goal axes' largest speed that is used at most; as forwarded, else as asked
    kind: DriverKind = "none"  # of its sender; "none" in recordings from before there were policies


class FeedbackRecord(OwnRecord, frozen=True, kw_only=True):
    """Measured state after command `event`, as the robot bridge sent it (docs/robot-link.md)."""

    issue: Annotated[int, msgspec.Meta(ge=1)]
    time: float  # s, the bridge's monotonic clock
    axes: list[float]
    joints: list[float] = []
    goals: list[float | None] = []  # where the goal axes were commanded to be, null for a rate axis; empty without any
    wrench: list[float] = []
    ranges: list[float] = []
    at_rest: bool = True
    stop: StopState = StopState()
    faults: list[str] = []
    limits: list[str] = []
    unknown: list[str] = []
    nonce: int = 0  # of this issue; 0 in recordings from before there were nonces
    neutral_needed: bool = False  # no moving command executes before a neutral one
    warning: float = 0.0  # s that the robot still warns before it may move
    driver: str = ""  # name of the sender of the command that became this event
    driver_kind: DriverKind = "none"  # "none": no command became it, or an old recording
    intervention: bool = False  # of a person, in an episode in which a policy has driven before


class RefusalRecord(OwnRecord, frozen=True, kw_only=True):
    """Something was refused; `event` is the current one."""

    refused: Count  # the refused command's event; 0 if it was no command
    reason: RefusalReason
    detail: str = ""
    by: Literal["console", "robot"]
    peer: str = ""  # peer that was told; "" for nobody
    name: str = ""


class RestRecord(OwnRecord, frozen=True, kw_only=True):
    """A rest that went to the robot; `event` is the one that it names."""

    peer: str = ""  # "" when the console sent it because the seat changed hands
    why: str = ""


class SeatRecord(OwnRecord, frozen=True, kw_only=True):
    """Who may drive from now on; at the start of every file and whenever it changes."""

    holder: str  # peer; "" when the seat is free
    name: str = ""
    role: str = ""
    why: str = ""  # "request", "granted", "taken", "released", "disconnected", "heartbeat lost", "idle"


class ShadowRecord(OwnRecord, frozen=True, kw_only=True):
    """What a shadow policy wanted for `event`, which somebody else drove; it never reached the robot."""

    peer: str
    name: str
    values: list[float | None]  # as it sent them
    judgement: ShadowJudgement
    difference: float | None = None  # to what was done, as a share of the range of the axis that is furthest apart
    driver_kind: DriverKind = "none"  # of who drove the event; "none": not compared


class StopRecord(OwnRecord, frozen=True, kw_only=True):
    """Somebody pressed STOP, the robot took that press, or a stop was released. What held when is in the feedback."""

    kind: Literal["stop", "taken", "reset"]
    by: str
    where: str  # the channel, "http", "board", or "robot"
    reason: str = ""
    delivered: bool = True  # False: there was no robot link
    press: str = ""  # id of the press; "" of a reset
    number: int = 0  # of the stop that was taken or released; 0 if not known yet
    kept: bool = True  # the stop that was taken is on the robot's disk


class ActionRecord(OwnRecord, frozen=True, kw_only=True):
    """A request for an action went to the robot, or somebody said how one does; `event` is the current one then."""

    id: str  # of the request; "" of a cancel of whatever moves
    name: str
    state: ActionState | Literal["asked", "cancel"]
    by: str  # who asked, or cancels; "" for the console
    peer: str = ""  # of the request or the cancel, over a data channel
    reason: ActionReason = ""
    progress: float = 0.0
    text: str = ""
    moves: bool = False
    parameters: dict[str, ParameterValue] = {}  # of the request
    nonce: int = 0  # of the feedback that the request answers


class StatusRecord(OwnRecord, frozen=True, kw_only=True):
    """What the robot said of itself; the age of a reading is that at its arrival."""

    items: list[StatusItem]


class MapRecord(OwnRecord, frozen=True, kw_only=True):
    """The robot's map from this event on; its `cells` are in base64. Repeated once a minute."""

    map: OccupancyMap


class NavigationRecord(OwnRecord, frozen=True, kw_only=True):
    """Where the robot is on its map, and where it is going; whenever one of these has changed."""

    map: MapId = ""  # of the newest map
    located: bool = True  # False: the robot does not know where it is on the map
    frame: PlanarPose = (0.0, 0.0, 0.0)  # pose, in the map's frame, of the frame of the robot's measured pose
    goal: list[Coordinate] = []  # x, y and yaw in the map's frame; empty: none
    path: list[Coordinate] = []  # x and y in turn


class ParticipantsRecord(OwnRecord, frozen=True, kw_only=True):
    """Who is there, at the start of every file and whenever it changes."""

    participants: list[Participant]


class ReportRecord(OwnRecord, frozen=True, kw_only=True):
    """What the page of the seat's holder says of itself: what it rendered, with which gaps."""

    peer: str
    name: str
    report: Report


class TraceRecord(OwnRecord, frozen=True, kw_only=True):
    """Where the time of `event` went (docs/traces.md). Several records of an event complete each other."""

    peer: str = ""  # whose client has measured it; "": bridge and console
    name: str = ""
    command: CommandSpans = CommandSpans()
    stream: str = ""  # camera of the picture; "": there is no picture in this record
    picture: PictureSpans = PictureSpans()  # of the first picture of this camera that is stamped with the event


class NoteRecord(OwnRecord, frozen=True, kw_only=True):
    """What somebody wrote to everyone."""

    peer: str
    name: str
    role: str
    text: str


class EpisodeRecord(OwnRecord, frozen=True, kw_only=True):
    """What became of an episode (docs/episodes.md). One counts only if a file has its `start` and then its `kept`."""

    episode: str  # id
    number: Count  # counts the takes of a recording
    kind: Literal["start", "mark", "kept", "discarded", "cut"]
    task: str
    outcome: EpisodeOutcome = ""  # of `kept`
    first_event: EventReference  # that held at its start
    last_event: EventReference  # that held at its end; of `start` and `mark` that of the record
    by: str = ""  # who asked for it; "" for the console
    why: str = ""  # of `cut`: "epoch", "link_down", "recording_ended", "console_ended"
    text: str = ""  # of `mark`
    drivers: list[str] = []  # names of all that held the seat in it, so far
    problems: list[str] = []  # what the live checks have seen in it, so far: "camera_missing front"


class Degraded(OwnRecord, frozen=True, kw_only=True):
    """The recorder was too slow and left records out before this one. Without it a recording has no gaps."""

    lost: Annotated[int, msgspec.Meta(ge=1)]


class SignatureRecord(OwnRecord, frozen=True, kw_only=True):
    """The last message of a chunk: signs all that is in the file up to here (docs/recording.md, "Signatures")."""

    recording: str
    part: Annotated[int, msgspec.Meta(ge=1)]
    number: Annotated[int, msgspec.Meta(ge=1)]  # counts the signatures of the file
    until: Count  # ns since 1970, arrival of the last record that it signs
    final: bool  # nothing follows it
    head: str  # of the hash chain, 64 hexadecimal digits
    previous: str  # head of the part before; "" in the first part
    audit: str  # newest signed head of the audit, JSON; "" when there was none
    key: str  # Ed25519 public key, 64 hexadecimal digits
    signature: str  # 128 hexadecimal digits


class Vector(msgspec.Struct, frozen=True):
    x: float
    y: float
    z: float


class WrenchRecord(OwnRecord, frozen=True, kw_only=True):
    """Force and torque, named as in geometry_msgs/WrenchStamped."""

    frame_id: str  # the body that the sensor sits on
    force: Vector  # N
    torque: Vector  # N m


OWN_RECORDS: dict[str, type[OwnRecord]] = {
    "lockstep.Robot": RobotRecord,
    "lockstep.Command": CommandRecord,
    "lockstep.Feedback": FeedbackRecord,
    "lockstep.Refusal": RefusalRecord,
    "lockstep.Rest": RestRecord,
    "lockstep.Seat": SeatRecord,
    "lockstep.Shadow": ShadowRecord,
    "lockstep.Stop": StopRecord,
    "lockstep.Action": ActionRecord,
    "lockstep.Status": StatusRecord,
    "lockstep.Map": MapRecord,
    "lockstep.Navigation": NavigationRecord,
    "lockstep.Participants": ParticipantsRecord,
    "lockstep.Report": ReportRecord,
    "lockstep.Trace": TraceRecord,
    "lockstep.Note": NoteRecord,
    "lockstep.Episode": EpisodeRecord,
    "lockstep.Degraded": Degraded,
    "lockstep.Wrench": WrenchRecord,
    "lockstep.Signature": SignatureRecord,
}
"""By the name of their schema."""
