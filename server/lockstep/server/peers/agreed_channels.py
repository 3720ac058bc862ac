"""Data channels that an offer names (RFC 8864), so that neither side waits for a message that opens them. No I/O."""

import re
from collections.abc import Sequence
from typing import NamedTuple

from lockstep.rtc.sctp import SctpSettings
from lockstep.server.errors import BadSdp, ChannelError
from lockstep.server.peers.channels import CHANNELS, ChannelName, channel_name

__all__ = ["AgreedChannel", "agreed_channels"]

MAX_ID = SctpSettings().max_streams - 1
MAX_RETRANSMITS = 65535  # RFC 8832 5.1: 16 bits carry it
MAP = re.compile(r'(\d{1,5}) ([^;"=]+="?[^;"]*"?(?:;[^;"=]+="?[^;"]*"?)*)')


class AgreedChannel(NamedTuple):
    """One of the console's channels, with the reliability that the peer chose."""

    id: int
    name: ChannelName
    ordered: bool
    max_retransmits: int | None  # None: as often as it takes


def agreed_channels(maps: Sequence[str]) -> list[AgreedChannel]:
    """Return the channels that an offer names by `a=dcmap`; none if the peer opens its channels itself.

    Raises:
        BadSdp: a malformed line, an unknown channel, or a channel twice.
    """
    if len(maps) > len(CHANNELS):
        raise BadSdp(f"the offer has more than {len(CHANNELS)} data channels")
    found = [_channel(each) for each in maps]
    if len({each.id for each in found}) < len(found) or len({each.name for each in found}) < len(found):
        raise BadSdp("a=dcmap: a data channel is named twice")
    return found


def _channel(text: str) -> AgreedChannel:
    parsed = MAP.fullmatch(text)
    if parsed is None or int(parsed[1]) > MAX_ID:
        raise BadSdp("the offer has an a=dcmap line that is not valid (RFC 8864 5.1)")
    options = dict(each.split("=", 1) for each in parsed[2].split(";"))
    if len(options) < parsed[2].count(";") + 1 or options.keys() - {"label", "ordered", "max-retr"}:
        raise BadSdp("a=dcmap: only label, ordered and max-retr are allowed, each once")
    try:
        name = channel_name(options.get("label", "").strip('"'))
    except ChannelError as error:
        raise BadSdp(f"a=dcmap: {error.detail}") from error
    return AgreedChannel(int(parsed[1]), name, _ordered(options.get("ordered", "true")), _repeats(options))


def _ordered(said: str) -> bool:
    if said not in ("true", "false"):
        raise BadSdp("a=dcmap: ordered must be true or false")
    return said == "true"


def _repeats(options: dict[str, str]) -> int | None:
    said = options.get("max-retr")
    if said is None:
        return None
    if not re.fullmatch(r"[0-9]{1,5}", said) or int(said) > MAX_RETRANSMITS:
        raise BadSdp(f"a=dcmap: max-retr must be 0 to {MAX_RETRANSMITS}")
    return int(said)
