"""WebRTC's data channels over one SCTP association, without I/O (RFC 8831, 8832)."""

from lockstep.rtc.channels.data_channels import DataChannels
from lockstep.rtc.channels.errors import ChannelNotOpen, TooManyChannels
from lockstep.rtc.channels.events import ChannelClosed, ChannelEvent, ChannelMessage, ChannelOpened, ChannelWritable

__all__ = [
    "ChannelClosed",
    "ChannelEvent",
    "ChannelMessage",
    "ChannelNotOpen",
    "ChannelOpened",
    "ChannelWritable",
    "DataChannels",
    "TooManyChannels",
]
