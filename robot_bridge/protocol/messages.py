"""Messages of the robot link (docs/robot-link.md). One MessagePack map each; the key `type` names the kind.

Unknown fields are ignored, unknown kinds refused.
"""

from typing import Annotated, Literal

import msgspec

from robot_bridge.protocol.description import RobotDescription
from robot_bridge.protocol.errors import MessageError
from robot_bridge.protocol.serial import MAX_EVENT

__all__ = [
    "PROTOCOL_VERSION",
    "Challenge",
    "Command",
    "EventNotice",
    "EventReference",
    "Feedback",
    "Goodbye",
    "Hello",
    "LinkMessage",
    "LinkRole",
    "Media",
    "MediaCodec",
    "Ping",
    "Pong",
    "Refusal",
    "RefusalReason",
    "Reset",
    "Rest",
    "Stop",
    "StopState",
    "decode_message",
    "encode_message",
]

PROTOCOL_VERSION = 1
MAX_AXES = 256

EventReference = Annotated[int, msgspec.Meta(ge=1, le=MAX_EVENT)]
IssueNumber = Annotated[int, msgspec.Meta(ge=1)]
AxisValues = Annotated[list[float], msgspec.Meta(max_length=MAX_AXES)]
Text = Annotated[str, msgspec.Meta(max_length=500)]
Proof = Annotated[bytes, msgspec.Meta(max_length=64)]

LinkRole = Literal["robot", "operator", "events", "media"]
MediaCodec = Literal["yuv420p", "mjpeg", "h264", "pcm_s16le"]

RefusalReason = Literal[
    "late",  # answers a feedback issued longer than max_event_age ago, or an issue the bridge no longer knows
    "out_of_order",  # neither the next event nor a repeat of the last
    "rested",  # voided by a rest that named this event
    "stopped",  # the robot is stopped
    "not_a_number",  # a value is NaN or infinite
    "wrong_size",  # not one value per axis
    "malformed",  # not a message of the protocol
    "no_seat",  # the sender does not hold the control seat
    "seat_taken",  # somebody else holds the control seat
    "declined",  # the seat's holder said no, or nothing in time
    "not_neutral",  # a new holder's first command has to be neutral
    "too_often",  # more notes than anyone can read
    "not_allowed",  # the sender's role does not permit it
    "link_down",  # the console has no robot link
]


class StopState(msgspec.Struct, frozen=True):
    """The latched stop. `by` and `reason` are empty unless stopped."""

    stopped: bool = False
    by: str = ""
    reason: str = ""


class Hello(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="hello"):
    """First message both ways. The bridge answers with its epoch and, but for `events`, the description.

    A client that knows the link's secret sends a nonce, and again with the proof when it is challenged.
    """

    version: int = PROTOCOL_VERSION
    role: LinkRole
    name: Text = ""  # who is calling, for logs
    epoch: Text = ""  # one run of a bridge; only the bridge sets it
    description: RobotDescription | None = None  # only the bridge sets it
    nonce: Proof = b""  # 32 random bytes of a client that knows the secret; else empty
    proof: Proof = b""  # that the sender knows the secret, for the nonces of both sides; else empty


class Challenge(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="challenge"):
    """The bridge's answer to a hello without proof: say hello again, with it."""

    nonce: Proof  # 32 random bytes


class Command(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="command"):
    """Event `event`, valid only as the answer to issue `issue` of feedback `event - 1`."""

    event: EventReference
    issue: IssueNumber
    values: AxisValues  # one per axis of the description, in its units


class Feedback(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="feedback"):
    """Measured state after command `event`. A later `issue` of the same event is the same event measured again."""

    event: EventReference
    issue: IssueNumber
    time: float  # s, the bridge's monotonic clock when it was issued
    axes: list[float]  # measured, in the axes' units
    joints: list[float] = []
    wrench: list[float] = []  # fx fy fz (N), tx ty tz (N m), in the sensor's frame; empty without a sensor
    ranges: list[float] = []  # m; range_max means nothing seen
    at_rest: bool = True
    stop: StopState = StopState()
    faults: list[str] = []
    limits: list[str] = []  # names of the position limits and geofences that slowed the robot since the last feedback
    unknown: list[str] = []  # names of axes and joints that could not be measured: their values are old


class Refusal(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="refusal"):
    """Why a command was not executed, and which event is current."""

    event: int  # the refused command's event; 0 when it could not be read
    reason: RefusalReason
    current: EventReference
    detail: Text = ""


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
    keyframe: bool = True  # decodable without earlier ones


class Rest(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="rest"):
    """Bring the axes to rest unless an event newer than `event` was executed; voids moving commands up to `event`."""

    event: EventReference


class Stop(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="stop"):
    """Latch the stop."""

    by: Text = ""
    reason: Text = ""


class Reset(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="reset"):
    """Release the latched stop. Moves nothing."""

    by: Text = ""


class Ping(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="ping"):
    """Heartbeat; answered at once by a pong with the same id."""

    id: int


class Pong(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="pong"):
    id: int


class Goodbye(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="goodbye"):
    """Why the sender closes the connection; always its last message."""

    error: Text  # a stable name: "version", "taken", "malformed", "silent", "closing" …
    detail: Text = ""


LinkMessage = (
    Hello | Challenge | Command | Feedback | Refusal | EventNotice | Media | Rest | Stop | Reset | Ping | Pong | Goodbye
)

_decoder: msgspec.msgpack.Decoder[LinkMessage] = msgspec.msgpack.Decoder(LinkMessage)
_encoder = msgspec.msgpack.Encoder()


def encode_message(message: LinkMessage) -> bytes:
    """One message as a MessagePack map, without the length prefix."""
    return _encoder.encode(message)


def decode_message(data: bytes | bytearray | memoryview) -> LinkMessage:
    """The message in `data`.

    Raises:
        MessageError: not MessagePack, an unknown kind, or a field of the wrong type or range.
    """
    try:
        return _decoder.decode(data)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise MessageError(str(error)) from error
