"""Parses the messages of clients on data channels and lines. Raises named ChannelErrors and nothing else."""

import json
from typing import Literal

import msgspec

from lockstep.protocol.actions import Act, ActionCancel
from lockstep.protocol.console import (
    ClientMessage,
    Note,
    Rename,
    Report,
    SeatDecline,
    SeatGrant,
    SeatOffer,
    SeatRelease,
    SeatRequest,
    SeatTake,
    Shadow,
    SilenceStops,
    decode_client_message,
)
from lockstep.protocol.episodes import EpisodeRequest
from lockstep.protocol.errors import MessageError
from lockstep.protocol.messages import Command, Ping, Reset, Rest, Stop
from lockstep.protocol.traces.trace_messages import TraceReport, TraceRequest
from lockstep.rtc.token_bucket import TokenBucket
from lockstep.server.errors import BinaryMessage, Flood, MalformedMessage, MessageTooLarge, UnknownChannel, WrongChannel
from lockstep.server.stop.stop_presses import MAX_REASON, stop_text

__all__ = [
    "CHANNELS",
    "MAX_MESSAGE",
    "ChannelName",
    "MessageBudget",
    "channel_name",
    "channel_of",
    "parse_message",
    "stop_in",
]

ChannelName = Literal["control", "session", "stop"]


class _AnyStop(msgspec.Struct, frozen=True, kw_only=True):
    type: Literal["stop"]  # no tag: msgspec accepts a message that lacks the only possible tag
    reason: object = ""
    press: object = ""


CHANNELS: dict[ChannelName, tuple[type[ClientMessage], ...]] = {
    "control": (Command, Rest, Report, Ping, TraceReport, Shadow, Stop),  # a stop is accepted on every channel
    "session": (
        *(SeatRequest, SeatGrant, SeatDecline, SeatTake, SeatOffer, SeatRelease),
        *(SilenceStops, Rename, Note),
        *(Act, ActionCancel, EpisodeRequest, TraceRequest, Stop),
    ),
    "stop": (Stop, Reset),
}

# On a line, which carries all channels, the kind of a message tells its channel; a stop is for `stop`, the last here.
CHANNEL_OF: dict[type[ClientMessage], ChannelName] = {kind: name for name in CHANNELS for kind in CHANNELS[name]}

_any_stop = msgspec.json.Decoder(_AnyStop)

MAX_MESSAGE = 16 * 1024  # bytes; a report of 32 streams is the largest, about 7 kB


def channel_name(label: str) -> ChannelName:
    """Return the channel with this label.

    Raises:
        UnknownChannel: there is no such channel.
    """
    for name in CHANNELS:
        if label == name:
            return name
    raise UnknownChannel(f"the channels are {', '.join(CHANNELS)}")


def channel_of(message: ClientMessage) -> ChannelName:
    return CHANNEL_OF[type(message)]


def parse_message(channel: ChannelName | None, data: object) -> ClientMessage:
    """Parse a client's message on `channel`; None: on a line, which carries all channels.

    Raises:
        BinaryMessage: not text.
        MessageTooLarge: longer than MAX_MESSAGE.
        MalformedMessage: not JSON, an unknown kind, or a field of the wrong type or range.
        WrongChannel: this kind is not for this channel.
    """
    if not isinstance(data, str):
        raise BinaryMessage("a message must be text")
    if len(data) > MAX_MESSAGE:
        raise MessageTooLarge(f"{len(data)} characters, the bound is {MAX_MESSAGE}")
    try:
        message = decode_client_message(data)
    except MessageError as error:
        raise MalformedMessage(error.detail) from error
    if channel is not None and not isinstance(message, CHANNELS[channel]):
        raise WrongChannel(f"{type(message).__name__.lower()} does not belong on {channel}")
    return message


def stop_in(data: object) -> Stop | None:
    """Return the stop in a message that `parse_message` refuses: any message of type stop, whatever its faults."""
    if not isinstance(data, str | bytes) or len(data) > MAX_MESSAGE:
        return None
    try:
        found = _any_stop.decode(data)
    except (msgspec.DecodeError, UnicodeError, RecursionError):
        return _stop_in_text_cut_short(data)
    return Stop(reason=stop_text(found.reason)[:MAX_REASON], press=stop_text(found.press))


def _stop_in_text_cut_short(data: str | bytes) -> Stop | None:
    """Parse JSON with half of a surrogate pair in it, as in text that was cut within an emoji."""
    try:
        found = msgspec.convert(_whole(json.loads(data)), _AnyStop)
    except (ValueError, RecursionError):
        return None
    return Stop(reason=stop_text(found.reason)[:MAX_REASON], press=stop_text(found.press))


def _whole(value: object) -> object:
    """Return an object without halves of surrogate pairs in its texts."""
    if not isinstance(value, dict):
        return value
    return {
        key: each.encode(errors="replace").decode() if isinstance(each, str) else each for key, each in value.items()
    }


class MessageBudget:
    """Bounds the messages of one peer. Stop messages are exempt."""

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._bucket = TokenBucket(rate, rate)

    def spend(self, now: float) -> None:
        """Count a message. Raises Flood when more than `rate` messages a second come, after a burst of as many."""
        if not self._bucket.take(now):
            raise Flood(f"more than {self._rate:g} messages a second")
