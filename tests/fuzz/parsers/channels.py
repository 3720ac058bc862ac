"""What data channels and the 3D scene's WebSocket must withstand, as one function of bytes.

The first byte chooses the channel and whether the rest comes as text. Whatever it is: only the documented errors come
out, and what is accepted is a message that belongs there and survives being written again.
"""

import math

from lockstep.protocol.console import ClientMessage, decode_client_message, encode_console_message
from lockstep.protocol.messages import Command
from lockstep.server.errors import BinaryMessage, ChannelError, MessageTooLarge, UnknownChannel
from lockstep.server.peers.channels import CHANNELS, MAX_MESSAGE, ChannelName, channel_name, parse_message
from lockstep.server.routes.scene_proxy import is_allowed

__all__ = ["try_input"]

NAMES: tuple[ChannelName, ...] = tuple(CHANNELS)


def message(channel: ChannelName, data: str | bytes) -> None:
    try:
        found = parse_message(channel, data)
    except ChannelError as error:
        if isinstance(data, bytes) is not isinstance(error, BinaryMessage):
            raise AssertionError("bytes are refused as such, and nothing else is") from error
        if isinstance(data, str) and (len(data) > MAX_MESSAGE) is not isinstance(error, MessageTooLarge):
            raise AssertionError("the bound is not where it is said to be") from error
        return
    if not isinstance(found, CHANNELS[channel]):
        raise AssertionError(f"{found} does not belong on {channel}")
    again: ClientMessage = decode_client_message(encode_console_message(found))
    if again != found and not _has_nan(found):
        raise AssertionError(f"{found} becomes {again}")


def _has_nan(found: ClientMessage) -> bool:
    return isinstance(found, Command) and any(value is not None and math.isnan(value) for value in found.values)


def label(text: str) -> None:
    try:
        if channel_name(text) != text:
            raise AssertionError("a channel of another name")
    except UnknownChannel:
        return


def try_input(data: bytes) -> None:
    """Raises whatever goes wrong."""
    code, rest = (data[0] if data else 0), data[1:]
    text = rest.decode(errors="surrogateescape" if code & 64 else "replace")
    if code % 5 < 3:
        message(NAMES[code % 5], rest if code & 128 else text)
    elif code % 5 == 3:
        label(text)
    else:
        is_allowed(rest)
