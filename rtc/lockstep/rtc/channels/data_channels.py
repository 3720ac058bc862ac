"""The data channels of one association: named, typed messages in both directions."""

from collections import Counter
from collections.abc import Callable

from lockstep.rtc.channels.backlog import Backlog
from lockstep.rtc.channels.channel_table import ChannelState, ChannelTable
from lockstep.rtc.channels.closing import ChannelClosing
from lockstep.rtc.channels.errors import ChannelNotOpen
from lockstep.rtc.channels.events import ChannelEvent, ChannelMessage, ChannelWritable
from lockstep.rtc.channels.opening import DCEP, ChannelOpening
from lockstep.rtc.dcep import Open, Reliability
from lockstep.rtc.sctp import (
    Association,
    Closed,
    Established,
    MessageReceived,
    OutgoingStreamsReset,
    SctpSettings,
    SendQueueFull,
    StreamsReset,
)

__all__ = ["DataChannels"]

# PPIDs, RFC 8831 8
STRING = 51
BINARY = 53
STRING_EMPTY = 56
BINARY_EMPTY = 57
EMPTY = b"\0"  # RFC 8831 6.6: SCTP has no empty message


class DataChannels:
    """Named, typed messages. The interface is that of `Association`, with channels in the place of streams; begin with
    `association.start`.

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
        self._table = ChannelTable(client=client, max_streams=settings.max_streams)
        self._channels = self._table.channels
        self._backlog = Backlog(self.association)
        self._closing = ChannelClosing(self._table, self.association, self._backlog)
        self._opening = ChannelOpening(self._table, self.association, self._closing, self.counts)

    # Methods for the owner

    def open(self, label: str, now: float, *, protocol: str = "", reliability: Reliability | None = None) -> int:
        """Open a channel, tell the peer, and return its number. `ChannelOpened` follows; messages may be sent at once.

        Raises:
            TooManyChannels: there are 64, or no stream of this end is left.
            ValueError: the label or the protocol is longer than 1,024 bytes.
            AssociationClosed: the association has ended.
        """
        return self._opening.open(Open(label, protocol, reliability or Reliability()), now)

    def open_negotiated(
        self, channel: int, label: str = "", *, protocol: str = "", reliability: Reliability | None = None
    ) -> None:
        """Add a channel that both ends have agreed upon by other means. It is open when the association is up.

        Raises:
            ValueError: the number is taken, or not below `max_streams`.
            TooManyChannels: there are 64.
        """
        self._table.add_negotiated(channel, Open(label, protocol, reliability or Reliability()))

    def send(self, channel: int, data: str | bytes, now: float) -> None:
        """Send a message.

        Raises:
            ChannelNotOpen: there is no such channel, or it is closing.
            MessageTooLarge: more than `association.max_message` bytes.
            SendQueueFull: too much waits on this channel; `ChannelWritable` follows when half of it has left.
            AssociationClosed: the association has ended.
        """
        target = self._channels.get(channel)
        if target is None or target.state is ChannelState.CLOSING:
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
                ordered=limits.ordered or target.state is ChannelState.CONNECTING,
                max_retransmits=limits.max_retransmits,
                lifetime=limits.lifetime,
            )
        except SendQueueFull:
            self._backlog.filled(channel)
            raise

    def tell_when_empty(self, channel: int) -> None:
        """Tell once, with `ChannelWritable`, when nothing waits on the channel."""
        if channel in self._channels:
            self._backlog.watch(channel)

    def close(self, channel: int, now: float) -> None:
        """Close a channel when its waiting messages have left; `ChannelClosed` follows. No effect on a channel that
        does not exist."""
        self._closing.close(channel, now)

    # The interface of every core

    def receive_packet(self, data: bytes, now: float) -> None:
        """Take a packet that DTLS delivered."""
        self.association.receive_packet(data, now)
        self._take_events(now)

    def packets_to_send(self) -> list[bytes]:
        """Return every due packet, as of the last `now`."""
        packets = self.association.packets_to_send()
        if self._closing.waiting and self._closing.reset_ready(self.association.now):
            packets += self.association.packets_to_send()
        if self._backlog.full or self._backlog.watched:
            self._table.events += [ChannelWritable(channel) for channel in self._backlog.take_writable()]
        return packets

    def timer(self) -> float | None:
        """Return the time at which `handle_timer` is due; None: never."""
        return self.association.timer()

    def handle_timer(self, now: float) -> None:
        """Repeat unacknowledged messages."""
        self.association.handle_timer(now)
        self._take_events(now)

    def abort(self, now: float, reason: str = "aborted") -> None:
        """End at once; `Closed` with this reason is next."""
        self.association.abort(now, reason)
        self._take_events(now)

    @property
    def has_events(self) -> bool:
        """True if `events` has something."""
        return bool(self._table.events)

    def events(self) -> list[ChannelEvent]:
        """Return the events since the last call."""
        events, self._table.events = self._table.events, []
        return events

    # Events of the association

    def _take_events(self, now: float) -> None:
        for event in self.association.events():
            if isinstance(event, MessageReceived):
                self._receive(event, now)
            elif isinstance(event, StreamsReset):
                self._closing.reset_by_peer(event.streams, now)
            elif isinstance(event, OutgoingStreamsReset):
                self._closing.reset_here(event.streams)
            elif isinstance(event, Established):
                self._table.established(event)
            else:
                self.closed = event
                self._closing.clear()
                self._backlog.clear()
                self._table.ended(event)

    def _receive(self, message: MessageReceived, now: float) -> None:
        if message.protocol == DCEP:
            self._opening.receive(message.stream, message.payload, now)
            return
        channel = self._channels.get(message.stream)
        if channel is None or channel.state is ChannelState.CLOSING:
            self.counts["no_channel"] += 1
            return
        if channel.state is ChannelState.CONNECTING:
            self._table.opened(channel)  # its answer was overtaken
        try:
            data = _content(message)
        except UnicodeDecodeError:
            self.counts["not_utf8"] += 1
            return
        if data is None:
            self.counts["unknown_ppid"] += 1
            return
        self._table.events.append(ChannelMessage(message.stream, data))


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
