"""The events of data channels for their owner."""

from dataclasses import dataclass
from typing import NamedTuple

from lockstep.rtc.dcep import Reliability
from lockstep.rtc.sctp import Closed, Established

__all__ = ["ChannelClosed", "ChannelEvent", "ChannelMessage", "ChannelOpened", "ChannelWritable"]


@dataclass(frozen=True, slots=True)
class ChannelOpened:
    """A channel is open at both ends. `channel` is the number of its stream, which names it from here on."""

    channel: int
    label: str
    protocol: str
    reliability: Reliability
    by_peer: bool


class ChannelMessage(NamedTuple):
    """A message: text or bytes, as it was sent. A tuple for the sake of speed, like `MessageReceived`."""

    channel: int
    data: str | bytes


@dataclass(frozen=True, slots=True)
class ChannelWritable:
    """A channel whose queue was full has room again, or nothing waits any more on one that `tell_when_empty` named."""

    channel: int


@dataclass(frozen=True, slots=True)
class ChannelClosed:
    """Both ends have closed the channel, or the association has ended. The number may be used again."""

    channel: int


ChannelEvent = Established | ChannelOpened | ChannelMessage | ChannelWritable | ChannelClosed | Closed
