"""WebRTC's data channels over one SCTP association, without I/O (RFC 8831, 8832)."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

from lockstep.rtc.dcep import ACK, DcepError, Open, Reliability, decode_open
from lockstep.rtc.sctp import (
    Association,
    Closed,
    Established,
    MessageReceived,
    OutgoingStreamsReset,
    SctpSettings,
    SendQueueFull,
    State,
    StreamsReset,
)

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

MAX_CHANNELS = 64  # at a time, which a peer cannot exceed either

# PPIDs, RFC 8831 8
DCEP = 50
STRING = 51
BINARY = 53
STRING_EMPTY = 56
BINARY_EMPTY = 57
EMPTY = b"\0"  # RFC 8831 6.6: SCTP has no empty message


class ChannelNotOpen(Exception):
    """There is no such channel, or it is closing."""


class TooManyChannels(Exception):
    """No stream is left for another channel."""


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


class _State(Enum):
    CONNECTING = 1  # DATA_CHANNEL_OPEN is on its way
    OPEN = 2
    CLOSING = 3


@dataclass(slots=True, eq=False)
class _Channel:
    stream: int
    what: Open
    state: _State
    by_peer: bool
    outgoing_reset: bool = False
    incoming_reset: bool = False


class DataChannels:
    """Named, typed messages. The interface is that of `Association`, with channels in the place of streams.

    `client` is the DTLS role, which decides whose streams are even (RFC 8832 6). Channels may be opened and written to
    before the association is up, and before the peer has answered: the first messages travel with the handshake.
    """

    def __init__(
        self,
        settings: SctpSettings,
        random_bytes: Callable[[int], bytes],
        *,
        client: bool,
        peer_port: int | None = None,
        peer_max_message: int | None = None,
    ) -> None:
        """`random_bytes`, `peer_port` and `peer_max_message` are as in `Association`."""
        self.association = Association(settings, random_bytes, peer_port=peer_port, peer_max_message=peer_max_message)
        self.counts: Counter[str] = self.association.counts
        self.is_client = client
        self.closed: Closed | None = None  # the reason that the association has ended; None: it has not
        self._parity = 0 if client else 1
        self._streams = settings.max_streams
        self._is_up = False
        self._channels: dict[int, _Channel] = {}
        self._closing: set[int] = set()  # channels whose streams are to be reset when nothing waits on them
        self._full: set[int] = set()
        self._watched: set[int] = set()  # channels whose owner is told when nothing waits on them
        self._half_full = settings.send_queue // 2
        self._events: list[ChannelEvent] = []

    # Methods for the owner

    def start(self, now: float) -> None:
        """Begin the handshake."""
        self.association.start(now)

    def open(self, label: str, now: float, *, protocol: str = "", reliability: Reliability | None = None) -> int:
        """Open a channel, tell the peer, and return its number. `ChannelOpened` follows; messages may be sent at once.

        Raises:
            TooManyChannels: there are 64, or no stream of this end is left.
            ValueError: the label or the protocol is longer than 1,024 bytes.
            AssociationClosed: the association has ended.
        """
        what = Open(label, protocol, reliability or Reliability())
        message = what.encode()
        stream = next((each for each in range(self._parity, self._streams, 2) if each not in self._channels), None)
        if stream is None or len(self._channels) >= MAX_CHANNELS:
            raise TooManyChannels(f"{len(self._channels)} channels are open")
        self.association.send(stream, DCEP, message, now)
        self._channels[stream] = _Channel(stream, what, _State.CONNECTING, by_peer=False)
        return stream

    def open_negotiated(
        self, channel: int, label: str = "", *, protocol: str = "", reliability: Reliability | None = None
    ) -> None:
        """Add a channel that both ends have agreed upon by other means. It is open when the association is up.

        Raises:
            ValueError: the number is taken, or not below `max_streams`.
            TooManyChannels: there are 64.
        """
        if channel in self._channels or not 0 <= channel < self._streams:
            raise ValueError(f"channel {channel} is taken or out of range")
        if len(self._channels) >= MAX_CHANNELS:
            raise TooManyChannels(f"{len(self._channels)} channels are open")
        what = Open(label, protocol, reliability or Reliability())
        added = self._channels[channel] = _Channel(channel, what, _State.OPEN, by_peer=False)
        if self._is_up:
            self._opened(added)

    def send(self, channel: int, data: str | bytes, now: float) -> None:
        """Send a message.

        Raises:
            ChannelNotOpen: there is no such channel, or it is closing.
            MessageTooLarge: more than `association.max_message` bytes.
            SendQueueFull: too much waits on this channel; `ChannelWritable` follows when half of it has left.
            AssociationClosed: the association has ended.
        """
        target = self._channels.get(channel)
        if target is None or target.state is _State.CLOSING:
            raise ChannelNotOpen(f"channel {channel} is not open")
        if isinstance(data, str):
            protocol, payload = (STRING, data.encode()) if data else (STRING_EMPTY, EMPTY)
        else:
            protocol, payload = (BINARY, bytes(data)) if data else (BINARY_EMPTY, EMPTY)
        limits = target.what.reliability
        try:
            self.association.send(
                channel,
                protocol,
                payload,
                now,
                # RFC 8832 6: not before the OPEN, so in order until the peer has answered it
                ordered=limits.ordered or target.state is _State.CONNECTING,
                max_retransmits=limits.max_retransmits,
                lifetime=limits.lifetime,
            )
        except SendQueueFull:
            self._full.add(channel)
            raise

    def buffered(self, channel: int) -> int:
        """Return the number of bytes that wait on a channel, without newest-wins messages."""
        return self.association.buffered(channel)

    def has_waiting(self, channel: int) -> bool:
        """True if a message, or a part of one, has not left yet."""
        return self.association.has_waiting(channel)

    def tell_when_empty(self, channel: int) -> None:
        """Tell once, with `ChannelWritable`, when nothing waits on the channel."""
        if channel in self._channels:
            self._watched.add(channel)

    def close(self, channel: int, now: float) -> None:
        """Close a channel when its waiting messages have left; `ChannelClosed` follows. No effect on a channel that
        does not exist."""
        target = self._channels.get(channel)
        if target is None or target.state is _State.CLOSING:
            return
        target.state = _State.CLOSING
        self._closing.add(channel)
        self._reset_closing(now)

    # The interface of every core

    def receive_packet(self, data: bytes, now: float) -> None:
        """Take a packet that DTLS delivered."""
        self.association.receive_packet(data, now)
        self._take_events(now)

    def packets_to_send(self) -> list[bytes]:
        """Return every due packet, as of the last `now`."""
        packets = self.association.packets_to_send()
        if self._closing and self._reset_closing(self.association.now):
            packets += self.association.packets_to_send()
        if self._full or self._watched:
            self._find_writable()
        return packets

    def timer(self) -> float | None:
        """Return the time at which `handle_timer` is due; None: never."""
        return self.association.timer()

    def handle_timer(self, now: float) -> None:
        """Repeat unacknowledged messages."""
        self.association.handle_timer(now)
        self._take_events(now)

    def shutdown(self, now: float) -> None:
        """End when everything has arrived; `Closed` follows."""
        self.association.shutdown(now)
        self._take_events(now)

    def abort(self, now: float, reason: str = "aborted") -> None:
        """End at once; `Closed` with this reason is next."""
        self.association.abort(now, reason)
        self._take_events(now)

    @property
    def has_events(self) -> bool:
        """True if `events` has something."""
        return bool(self._events)

    def events(self) -> list[ChannelEvent]:
        """Return the events since the last call."""
        events, self._events = self._events, []
        return events

    # Events of the association

    def _take_events(self, now: float) -> None:
        for event in self.association.events():
            if isinstance(event, MessageReceived):
                self._receive(event, now)
            elif isinstance(event, StreamsReset):
                for stream in event.streams or tuple(self._channels):
                    self._reset_by_peer(stream, now)
            elif isinstance(event, OutgoingStreamsReset):
                for stream in event.streams:
                    if (channel := self._channels.get(stream)) is not None:
                        channel.outgoing_reset = True
                        self._close_when_reset(channel)
            elif isinstance(event, Established):
                self._established(event)
            else:
                self._ended(event)

    def _established(self, event: Established) -> None:
        self._is_up = True
        self._streams = min(self._streams, event.streams)
        self._events.append(event)
        for channel in self._channels.values():
            if channel.state is _State.OPEN:
                self._opened(channel)

    def _ended(self, event: Closed) -> None:
        self.closed = event
        self._events += [ChannelClosed(stream) for stream in self._channels]
        self._channels.clear()
        self._closing.clear()
        self._full.clear()
        self._watched.clear()
        self._events.append(event)

    def _opened(self, channel: _Channel) -> None:
        what = channel.what
        self._events.append(ChannelOpened(channel.stream, what.label, what.protocol, what.reliability, channel.by_peer))

    def _receive(self, message: MessageReceived, now: float) -> None:
        if message.protocol == DCEP:
            self._receive_dcep(message.stream, message.payload, now)
            return
        channel = self._channels.get(message.stream)
        if channel is None or channel.state is _State.CLOSING:
            self.counts["no_channel"] += 1
            return
        if channel.state is _State.CONNECTING:
            self._acknowledged(channel)  # its answer was overtaken
        try:
            data = _content(message)
        except UnicodeDecodeError:
            self.counts["not_utf8"] += 1
            return
        if data is None:
            self.counts["unknown_ppid"] += 1
            return
        self._events.append(ChannelMessage(message.stream, data))

    def _receive_dcep(self, stream: int, payload: bytes, now: float) -> None:
        channel = self._channels.get(stream)
        if payload == ACK:
            if channel is not None and channel.state is _State.CONNECTING:
                self._acknowledged(channel)
            return
        try:
            what = decode_open(payload)
        except DcepError:
            self._refuse(stream, "dcep_malformed", now)
            return
        # RFC 8832 6: an unused stream, of the peer's parity
        if channel is not None:
            self._refuse(stream, "channel_exists", now)
        elif stream % 2 == self._parity:
            self._refuse(stream, "channel_parity", now)
        elif len(self._channels) >= MAX_CHANNELS:
            self._refuse(stream, "too_many_channels", now)
        elif self.association.state is not State.ESTABLISHED:
            self.counts["unexpected"] += 1  # it is shutting down
        else:
            added = self._channels[stream] = _Channel(stream, what, _State.OPEN, by_peer=True)
            self.association.send(stream, DCEP, ACK, now)
            self._opened(added)

    def _acknowledged(self, channel: _Channel) -> None:
        channel.state = _State.OPEN
        self._opened(channel)

    def _refuse(self, stream: int, why: str, now: float) -> None:
        """Close the channel, and do not answer (RFC 8832 6)."""
        self.counts[why] += 1
        if stream in self._channels:
            self.close(stream, now)
        else:
            self.association.reset_streams((stream,), now)

    # Closing, RFC 8831 6.7

    def _reset_by_peer(self, stream: int, now: float) -> None:
        channel = self._channels.get(stream)
        if channel is not None:
            channel.incoming_reset = True
            self.close(stream, now)
            self._close_when_reset(channel)

    def _reset_closing(self, now: float) -> bool:
        """Reset the closing channels on which nothing waits. Return True if there were any."""
        ready = tuple(stream for stream in self._closing if not self.association.has_waiting(stream))
        self._closing.difference_update(ready)
        if ready and not self.association.reset_streams(ready, now):
            for stream in ready:
                self._remove(stream)
        return bool(ready)

    def _close_when_reset(self, channel: _Channel) -> None:
        if channel.outgoing_reset and channel.incoming_reset:
            self._remove(channel.stream)

    def _remove(self, stream: int) -> None:
        del self._channels[stream]
        self._full.discard(stream)
        self._watched.discard(stream)
        self._events.append(ChannelClosed(stream))

    def _find_writable(self) -> None:
        for stream in [each for each in self._full if self.association.buffered(each) <= self._half_full]:
            self._full.remove(stream)
            self._events.append(ChannelWritable(stream))
        for stream in [each for each in self._watched if not self.association.has_waiting(each)]:
            self._watched.remove(stream)
            self._events.append(ChannelWritable(stream))


def _content(message: MessageReceived) -> str | bytes | None:
    """Return the content of a message; None for an unknown PPID.

    Raises:
        UnicodeDecodeError: text that is not UTF-8.
    """
    if message.protocol == STRING:
        return message.payload.decode()
    if message.protocol == BINARY:
        return message.payload
    if message.protocol == STRING_EMPTY:
        return ""
    return b"" if message.protocol == BINARY_EMPTY else None
