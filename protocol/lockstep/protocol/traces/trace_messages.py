"""Messages of the console about spans (docs/traces.md): a client asks for them, and may report its own.

The console sends nothing of this to a client that has not asked. Newest wins: what does not fit is left out.
"""

from typing import Annotated, Final

import msgspec

from lockstep.protocol.messages import EventReference
from lockstep.protocol.traces.trace import CommandSpans, PictureSpans

__all__ = [
    "MAX_TRACED_COMMANDS",
    "MAX_TRACED_EVENTS",
    "MAX_TRACED_PICTURES",
    "CommandTrace",
    "EventTrace",
    "PictureTrace",
    "TraceReport",
    "TraceRequest",
    "Traces",
]

MAX_TRACED_PICTURES: Final = 32  # in one message
MAX_TRACED_COMMANDS: Final = 16
MAX_TRACED_EVENTS: Final = 32

StreamName = Annotated[str, msgspec.Meta(max_length=500)]
RtpTime = Annotated[int, msgspec.Meta(ge=0, le=2**32 - 1)]


class PictureTrace(msgspec.Struct, frozen=True, kw_only=True):
    """The spans of one picture, as far as the console knows them."""

    stream: StreamName
    stamp: EventReference
    rtp_time: RtpTime  # RTP timestamp of its packets to this client
    spans: PictureSpans


class CommandTrace(msgspec.Struct, frozen=True, kw_only=True):
    """The spans of one executed command, as far as the console knows them."""

    event: EventReference
    spans: CommandSpans


class Traces(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="traces"):
    """What the console has measured since the last such message, newest last. Only to a client that asked."""

    pictures: Annotated[list[PictureTrace], msgspec.Meta(max_length=MAX_TRACED_PICTURES)] = []
    commands: Annotated[list[CommandTrace], msgspec.Meta(max_length=MAX_TRACED_COMMANDS)] = []


class TraceRequest(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="trace_request"):
    """Send traces from now on, or no more. Off at the beginning of a connection."""

    wanted: bool = True


class EventTrace(msgspec.Struct, frozen=True, kw_only=True):
    """One event as the operator's client has measured it, with what the console has told it."""

    event: EventReference
    command: CommandSpans = CommandSpans()
    stream: StreamName = ""  # camera of the picture; "" when none was shown yet
    picture: PictureSpans = PictureSpans()  # of the first picture stamped with this event


class TraceReport(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="trace_report"):
    """The operator's client reports its events while the session is recorded; nobody else is heard."""

    events: Annotated[list[EventTrace], msgspec.Meta(max_length=MAX_TRACED_EVENTS)] = []
