"""Messages on the console's data channels: JSON text, the key `type` names the kind (docs/console-api.md).

They stand here and not in `server/` because the server and the headless client both speak them and neither may
import the other. JSON Schemas and the page's TypeScript types are generated from this file (scripts/generate_wire.py).

| channel | reliability | client to server | server to client |
|---|---|---|---|
| control | unordered, 0 retransmits | command, rest, report, ping | feedback, refusal, pong |
| session | reliable | seat_request, seat_release, rename | welcome, robot, seat, participants, notice, refusal |
| stop | reliable | stop, reset | stop_state, refusal |
"""

from typing import Annotated, Literal

import msgspec

from robot_bridge.protocol.carriers import Carrier
from robot_bridge.protocol.description import RobotDescription
from robot_bridge.protocol.errors import MessageError
from robot_bridge.protocol.messages import (
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
)

__all__ = [
    "ClientMessage",
    "Notice",
    "Participant",
    "Participants",
    "Rename",
    "Report",
    "RobotState",
    "Role",
    "Seat",
    "SeatRelease",
    "SeatRequest",
    "ServerMessage",
    "StopStateNotice",
    "StreamInfo",
    "StreamReport",
    "Welcome",
    "decode_client_message",
    "decode_server_message",
    "encode_console_message",
]

Role = Literal["operator", "observer"]
Name = Annotated[str, msgspec.Meta(max_length=60)]
Count = Annotated[int, msgspec.Meta(ge=0)]
MAX_STREAMS = 32


class StreamReport(msgspec.Struct, frozen=True, kw_only=True):
    """How one stream does at a client, since it connected."""

    stream: Name
    carrier: Carrier
    stamp: Annotated[int, msgspec.Meta(ge=0)] = 0  # last one seen; 0 before the first
    gap: int = 0  # at the last rendering
    max_gap: int = 0  # largest |gap| rendered
    rendered: Count = 0
    discarded: Count = 0
    held: Count = 0


class Report(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="report"):
    """A client's statistics, a few times a second; also its heartbeat for the control seat."""

    event: Annotated[int, msgspec.Meta(ge=0)] = 0  # newest feedback; 0 before the first
    armed: bool = False
    streams: Annotated[list[StreamReport], msgspec.Meta(max_length=MAX_STREAMS)] = []
    picture_delay_ms: float | None = None  # command to picture, on the client's own clock
    round_trip_ms: float | None = None


class SeatRequest(msgspec.Struct, frozen=True, tag_field="type", tag="seat_request"):
    """Ask for the control seat; answered by `seat` to all, or by a refusal."""


class SeatRelease(msgspec.Struct, frozen=True, tag_field="type", tag="seat_release"):
    """Give the control seat back."""


class Rename(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="rename"):
    """The name that others see."""

    name: Name


class StreamInfo(msgspec.Struct, frozen=True, kw_only=True):
    """One negotiated medium."""

    mid: str  # the media section of the answer
    stream: str  # name of the camera or microphone
    label: str
    kind: Literal["video", "audio"]
    codec: str  # "H264", "VP8", "opus", "PCMU"
    carrier: Carrier


class Welcome(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="welcome"):
    """First message on `session`."""

    peer: str  # this connection's id
    role: Role
    name: str
    streams: list[StreamInfo]


class RobotState(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="robot"):
    """State of the robot link. A new epoch always comes with a new connection: the server closes the old one."""

    link: Literal["up", "down"]
    epoch: str
    description: RobotDescription
    detail: str = ""  # why it is down


class Seat(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="seat"):
    """Who may drive. `holder` is a peer id, empty when the seat is free."""

    holder: str = ""
    name: str = ""
    why: str = ""  # "released", "heartbeat lost", "disconnected" …


class Participant(msgspec.Struct, frozen=True, kw_only=True):
    peer: str
    name: str
    role: Role
    carrier: Carrier
    gap: int = 0
    picture_delay_ms: float | None = None


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


ClientMessage = Command | Rest | Report | Ping | SeatRequest | SeatRelease | Rename | Stop | Reset
ServerMessage = Feedback | Refusal | Pong | Welcome | RobotState | Seat | Participants | Notice | StopStateNotice

_client_decoder: msgspec.json.Decoder[ClientMessage] = msgspec.json.Decoder(ClientMessage)
_server_decoder: msgspec.json.Decoder[ServerMessage] = msgspec.json.Decoder(ServerMessage)
_encoder = msgspec.json.Encoder()


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
