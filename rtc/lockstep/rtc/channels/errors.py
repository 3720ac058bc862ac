"""The errors of data channels.

ChannelNotOpen
TooManyChannels
"""

__all__ = ["ChannelNotOpen", "TooManyChannels"]


class ChannelNotOpen(Exception):
    """There is no such channel, or it is closing."""


class TooManyChannels(Exception):
    """No stream is left for another channel."""
