"""The channels that exist, by their streams."""

from dataclasses import dataclass
from enum import Enum

from lockstep.rtc.channels.errors import TooManyChannels
from lockstep.rtc.channels.events import ChannelClosed, ChannelEvent, ChannelOpened
from lockstep.rtc.dcep import Open
from lockstep.rtc.sctp import Closed, Established

__all__ = ["Channel", "ChannelState", "ChannelTable"]

MAX_CHANNELS = 64  # at a time, which a peer cannot exceed either


class ChannelState(Enum):
    CONNECTING = 1  # DATA_CHANNEL_OPEN is on its way
    OPEN = 2
    CLOSING = 3


@dataclass(slots=True, eq=False)
class Channel:
    stream: int
    what: Open
    state: ChannelState
    by_peer: bool
    outgoing_reset: bool = False
    incoming_reset: bool = False


class ChannelTable:
    """Adds and removes channels, and tells of it in `events`, which their owner drains."""

    def __init__(self, *, client: bool, max_streams: int) -> None:
        """`client`: the DTLS role, which decides whose streams are even (RFC 8832 6)."""
        self.channels: dict[int, Channel] = {}
        self.events: list[ChannelEvent] = []
        self._parity = 0 if client else 1
        self._streams = max_streams
        self._is_up = False

    def free_stream(self) -> int:
        """Return a stream for a channel of this end. Raises TooManyChannels."""
        self._check_number()
        stream = next((each for each in range(self._parity, self._streams, 2) if each not in self.channels), None)
        if stream is None:
            raise TooManyChannels(f"{len(self.channels)} channels are open")
        return stream

    def add_negotiated(self, stream: int, what: Open) -> None:
        """Add a channel that both ends have agreed upon. Raises ValueError and TooManyChannels."""
        if stream in self.channels or not 0 <= stream < self._streams:
            raise ValueError(f"channel {stream} is taken or out of range")
        self._check_number()
        added = self.add(stream, what, ChannelState.OPEN)
        if self._is_up:
            self.opened(added)

    def add(self, stream: int, what: Open, state: ChannelState, *, by_peer: bool = False) -> Channel:
        """Add a channel on a stream that `free_stream` returned, or that has no `refusal`."""
        added = self.channels[stream] = Channel(stream, what, state, by_peer)
        return added

    def _check_number(self) -> None:
        if len(self.channels) >= MAX_CHANNELS:
            raise TooManyChannels(f"{len(self.channels)} channels are open")

    def refusal(self, stream: int) -> str:
        """Return the reason to refuse a channel that the peer opens; "" for none. RFC 8832 6: an unused stream, of the
        peer's parity."""
        if stream in self.channels:
            return "channel_exists"
        if stream % 2 == self._parity:
            return "channel_parity"
        return "too_many_channels" if len(self.channels) >= MAX_CHANNELS else ""

    def opened(self, channel: Channel) -> None:
        channel.state = ChannelState.OPEN
        what = channel.what
        self.events.append(ChannelOpened(channel.stream, what.label, what.protocol, what.reliability, channel.by_peer))

    def established(self, event: Established) -> None:
        """Note that the association is up."""
        self._is_up = True
        self._streams = min(self._streams, event.streams)
        self.events.append(event)
        for channel in self.channels.values():
            if channel.state is ChannelState.OPEN:
                self.opened(channel)

    def remove(self, stream: int) -> None:
        del self.channels[stream]
        self.events.append(ChannelClosed(stream))

    def ended(self, event: Closed) -> None:
        """Note that the association has ended."""
        self.events += [ChannelClosed(stream) for stream in self.channels]
        self.channels.clear()
        self.events.append(event)
