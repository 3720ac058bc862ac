"""Messages of the robot link (docs/robot-link.md). One MessagePack map each; the key `type` names the kind.

Unknown fields are ignored, unknown kinds refused.
"""

from collections.abc import Sequence
from operator import attrgetter
from typing import Annotated, Literal

import msgspec

from lockstep.protocol.actions import Act, ActionCancel, ActionUpdate, RenewedAction, Status
from lockstep.protocol.description import RobotDescription
from lockstep.protocol.errors import MessageError
from lockstep.protocol.maps import Navigation, OccupancyMap
from lockstep.protocol.serial import MAX_EVENT
from lockstep.protocol.traces.trace import CommandSpans, PictureSpans

__all__ = [
    "MAX_AXES",
    "MAX_FAULTS",
    "MAX_RAYS",
    "PROTOCOL_VERSION",
    "Challenge",
    "Command",
    "EncodeRequest",
    "EventNotice",
    "EventReference",
    "Feedback",
    "Goodbye",
    "Hello",
    "LinkMessage",
    "LinkMessageOnWire",
    "LinkRole",
    "Media",
    "MediaCodec",
    "Ping",
    "Pong",
    "Refusal",
    "RefusalReason",
    "Reset",
    "Rest",
    "RobotFeedback",
    "Stop",
    "StopState",
    "StopTaken",
    "StreamRequest",
    "decode_message",
    "encode_message",
    "plain_feedback",
    "spans_of",
]

PROTOCOL_VERSION = 2
MAX_AXES = 256
MAX_RAYS = 4096  # of a range ring
MAX_FAULTS = 64
MAX_LIMITS = 512
MAX_STREAMS = 32  # cameras and microphones of a robot
MAX_BITRATE = 100_000_000  # bit/s that may be asked for

EventReference = Annotated[int, msgspec.Meta(ge=1, le=MAX_EVENT)]
IssueNumber = Annotated[int, msgspec.Meta(ge=1, le=2**53 - 1)]  # a JavaScript number holds these exactly
PingId = Annotated[int, msgspec.Meta(ge=-(2**63), le=2**63 - 1)]
AxisValues = Annotated[list[float], msgspec.Meta(max_length=MAX_AXES)]
AxisGoals = Annotated[Sequence[float | None], msgspec.Meta(max_length=MAX_AXES)]
Share = Annotated[float, msgspec.Meta(ge=0, le=1)]
Text = Annotated[str, msgspec.Meta(max_length=500)]
Texts = Annotated[list[Text], msgspec.Meta(max_length=MAX_LIMITS)]
Proof = Annotated[bytes, msgspec.Meta(max_length=64)]
PressId = Annotated[str, msgspec.Meta(max_length=64)]
StopNumber = Annotated[int, msgspec.Meta(ge=0, le=2**53 - 1)]
Nonce = Annotated[int, msgspec.Meta(ge=0, le=2**53 - 1)]

LinkRole = Literal["robot", "operator", "events", "media"]
MediaCodec = Literal["yuv420p", "mjpeg", "h264", "pcm_s16le", "opus"]

RefusalReason = Literal[
    "late",  # answers a feedback issued longer than max_event_age ago, or an issue the bridge no longer knows
    "out_of_order",  # neither the next event nor a repeat of the last
    "rested",  # voided by a rest that named this event
    "stopped",  # the robot is stopped
    "not_a_number",  # a value is NaN or infinite
    "wrong_size",  # not one value per axis
    "jump",  # a goal is further from the measured value than the axis' reach
    "conflict",  # two of its values move the same joints
    "malformed",  # not a message of the protocol
    "no_seat",  # the sender does not hold the control seat
    "seat_taken",  # another peer holds the control seat
    "declined",  # the seat's holder said no, or nothing in time
    "not_neutral",  # a neutral command has to come first: new holder, stop, new link, fault, restart, suspend
    "unseen",  # its nonce is not that of the issue that it answers: the sender has not seen it
    "stale_reset",  # a reset that does not name the newest stop
    "too_soon",  # a reset within a second after the newest stop, or before a feedback showed that stop
    "not_kept",  # a reset that could not be written to the robot's disk
    "locked_out",  # a person at the robot has locked it
    "warning",  # the robot warns before it moves, and has not warned long enough
    "silenced",  # a supervisor silenced the stops of this link
    "too_often",  # more notes than anyone can read
    "not_allowed",  # the sender's role does not permit it
    "link_down",  # the console has no robot link
]


class StopState(msgspec.Struct, frozen=True):
    """The latched stop, and the number of the newest one. `by` and `reason` are empty unless stopped."""

    stopped: bool = False  # until a reset
    by: Text = ""  # who said the first stop since the last reset
    reason: Text = ""  # which that person gave
    number: StopNumber = 0  # of the newest stop, also after its reset; never given twice; 0 before the first
    press: PressId = ""  # id of the press that became the newest stop
    kept: bool = True  # whether this state is on the robot's disk
    locked_out: Text = ""  # why a person at the robot has locked it; "" while it is not locked


class Hello(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="hello"):
    """First message both ways. The bridge answers with its epoch and, but for `events`, the description.

    A client that knows the link's secret sends a nonce, and again with the proof when it is challenged.
    """

    version: int = PROTOCOL_VERSION
    role: LinkRole
    name: Text = ""  # the client's name, for logs
    epoch: Text = ""  # one run of a bridge; only the bridge sets it
    description: RobotDescription | None = None  # only the bridge sets it
    nonce: Proof = b""  # 32 random bytes of a client that knows the secret; else empty
    proof: Proof = b""  # that the sender knows the secret, for the nonces of both sides; else empty
    encodes: Annotated[list[Text], msgspec.Meta(max_length=8)] = []  # codecs that the bridge encodes and is asked for
    encodings: Annotated[int, msgspec.Meta(ge=1, le=16)] = 1  # of a camera, that the bridge makes at most


class Challenge(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="challenge"):
    """The bridge's answer to a hello without proof: say hello again, with it."""

    nonce: Proof  # 32 random bytes


class Command(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="command"):
    """Event `event`, valid only as the answer to issue `issue` of feedback `event - 1`."""

    event: EventReference
    issue: IssueNumber
    values: AxisGoals  # one per axis of the description, in its units; null: a goal axis stays where it is
    nonce: Nonce = 0  # of the issue that it answers: proof that the sender has seen it
    action: RenewedAction = ""  # id of the moving action that the armed sender lets go on; "": none
    speed: Share = 1.0  # of the goal axes' largest speed that is used at most


class Feedback(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="feedback"):
    """Measured state after command `event`. A later `issue` of the same event is the same event measured again."""

    event: EventReference  # the number of the latest executed command
    issue: IssueNumber  # 1 for an event's first feedback, one more each time it is measured again
    time: float  # s, the bridge's monotonic clock when it was issued
    axes: AxisValues  # measured, in the axes' units
    joints: AxisValues = []  # measured, in the joints' units
    goals: AxisGoals = []  # where the goal axes are commanded to be now, null for a rate axis; empty without any
    wrench: Annotated[
        list[float], msgspec.Meta(max_length=6)
    ] = []  # fx fy fz (N), tx ty tz (N m), in the sensor's frame; empty without a sensor
    ranges: Annotated[list[float], msgspec.Meta(max_length=MAX_RAYS)] = []  # m; range_max means nothing seen
    at_rest: bool = True  # nothing moves and nothing is commanded to
    stop: StopState = StopState()  # whether the robot is stopped, and why
    faults: Annotated[list[Text], msgspec.Meta(max_length=MAX_FAULTS)] = []  # what is wrong with the robot, for people
    limits: Texts = []  # names of the position limits and geofences that slowed the robot since the last feedback
    unknown: Texts = []  # names of axes and joints that could not be measured: their values are old
    nonce: Nonce = 0  # 53 random bits, new in every issue
    neutral_needed: bool = False  # no moving command executes before a neutral one
    warning: float = 0.0  # s that the robot still warns before it may move


class RobotFeedback(Feedback, frozen=True, kw_only=True, tag_field="type", tag="feedback"):
    """A feedback as it travels on the robot link. The console passes it on without the spans."""

    spans: CommandSpans | msgspec.UnsetType = msgspec.UNSET  # of the command; only in the first issue, and optional


class Refusal(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="refusal"):
    """Why a command was not executed, and which event is current."""

    event: Annotated[int, msgspec.Meta(ge=0, le=MAX_EVENT)]  # the refused command's event; 0 when it could not be read
    reason: RefusalReason
    current: EventReference
    detail: Text = ""
    stop: StopNumber = 0  # the stop that a refused reset named; 0 where nothing or something else was refused


class EventNotice(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="event"):
    """The event reference changed: for stampers that do not need the whole feedback."""

    event: EventReference
    time: float


class Media(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="media"):
    """One picture or audio segment, stamped with the event reference that held at its capture (never a newer one)."""

    stream: Text  # name of a camera or microphone of the description
    codec: MediaCodec
    stamp: EventReference
    time: float  # s, the bridge's monotonic clock at capture
    payload: bytes
    width: Annotated[int, msgspec.Meta(ge=0, le=8192)] = 0  # pixels; 0 for sound
    height: Annotated[int, msgspec.Meta(ge=0, le=8192)] = 0
    sample_rate: Annotated[int, msgspec.Meta(ge=0, le=192000)] = 0  # Hz; 0 for pictures
    channels: Annotated[int, msgspec.Meta(ge=0, le=8)] = 0
    keyframe: bool = True  # decodable without earlier ones of the same encoding
    second: bool = False  # a picture of the camera's second encoding, only for links that have asked for it
    spans: PictureSpans | msgspec.UnsetType = msgspec.UNSET  # the bridge's own, of a picture; optional


class StreamRequest(msgspec.Struct, frozen=True, kw_only=True):
    """How a bridge that encodes should encode one stream."""

    stream: Text
    bitrate: Annotated[int, msgspec.Meta(ge=0, le=MAX_BITRATE)] = 0  # bit/s at most; 0: as the bridge likes
    frame_rate: Annotated[float, msgspec.Meta(ge=0, le=240)] = 0.0  # pictures/s at most; 0: all
    scale: Annotated[float, msgspec.Meta(gt=0, le=1)] = 1.0  # of both sides of the camera's own pictures
    keyframes: Annotated[int, msgspec.Meta(ge=0, le=2**53 - 1)] = 0  # keyframes asked for so far on this link


class EncodeRequest(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="encode"):
    """What a client of role `media` asks of a bridge that encodes. The newest message on a link replaces all before."""

    streams: Annotated[list[StreamRequest], msgspec.Meta(max_length=MAX_STREAMS)]
    # cameras of which the link takes a second encoding, for others than the operator, while the request names them
    second: Annotated[list[StreamRequest], msgspec.Meta(max_length=MAX_STREAMS)] = []


class Rest(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="rest"):
    """Bring the axes to rest unless an event newer than `event` was executed; voids moving commands up to `event`."""

    event: EventReference


class Stop(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="stop"):
    """Latch the stop. Repeats of one press carry its id and are one stop."""

    by: Text = ""
    reason: Text = ""
    press: PressId = ""  # 16 random bytes in hex; "" makes every message a press of its own


class StopTaken(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="stop_taken"):
    """The bridge's answer to a stop, when the stop is on its disk or cannot be kept."""

    press: PressId
    number: StopNumber  # that this press has
    kept: bool = True  # False: latched, but not on the disk


class Reset(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="reset"):
    """Release the latched stop, if `number` is the newest. Moves nothing."""

    by: Text = ""
    number: StopNumber = 0  # of the newest stop that the sender has seen


class Ping(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="ping"):
    """Heartbeat; answered at once by a pong with the same id."""

    id: PingId


class Pong(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="pong"):
    id: PingId


class Goodbye(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="goodbye"):
    """Why the sender closes the connection; always its last message."""

    error: Text  # a stable name: "version", "taken", "malformed", "silent", "closing" …
    detail: Text = ""


_WithoutFeedback = (
    Hello
    | Challenge
    | Command
    | Refusal
    | EventNotice
    | Media
    | EncodeRequest
    | Rest
    | Stop
    | StopTaken
    | Reset
    | Act
    | ActionCancel
    | ActionUpdate
    | Status
    | Navigation
    | OccupancyMap
    | Ping
    | Pong
    | Goodbye
)
LinkMessage = _WithoutFeedback | Feedback
LinkMessageOnWire = _WithoutFeedback | RobotFeedback  # both feedbacks have one tag

_decoder: msgspec.msgpack.Decoder[LinkMessageOnWire] = msgspec.msgpack.Decoder(LinkMessageOnWire)
_encoder = msgspec.msgpack.Encoder()
_fields_of_feedback = attrgetter(*Feedback.__struct_fields__)


def encode_message(message: LinkMessage) -> bytes:
    """One message as a MessagePack map, without the length prefix."""
    return _encoder.encode(message)


def decode_message(data: bytes | bytearray | memoryview) -> LinkMessage:
    """The message in `data`. A feedback is a `RobotFeedback` if it has spans.

    Raises:
        MessageError: not MessagePack, an unknown kind, or a field of the wrong type or range.
    """
    try:
        message = _decoder.decode(data)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise MessageError(str(error)) from error
    if isinstance(message, RobotFeedback) and message.spans is msgspec.UNSET:
        return plain_feedback(message)
    return message


def plain_feedback(feedback: Feedback) -> Feedback:
    """Return the feedback without the spans that it may have on the robot link."""
    if not isinstance(feedback, RobotFeedback):
        return feedback
    return Feedback(**dict(zip(Feedback.__struct_fields__, _fields_of_feedback(feedback), strict=True)))


def spans_of(feedback: Feedback) -> CommandSpans:
    """Return the spans that the bridge has measured of the command; none are known of most feedbacks."""
    spans = feedback.spans if isinstance(feedback, RobotFeedback) else msgspec.UNSET
    return CommandSpans() if spans is msgspec.UNSET else spans
