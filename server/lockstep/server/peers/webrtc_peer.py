"""A peer on WebRTC: its connection and its data channels."""

import secrets
from collections.abc import Callable, Sequence
from typing import Protocol

from lockstep.rtc.channels import ChannelClosed, ChannelMessage, ChannelOpened, ChannelWritable
from lockstep.rtc.dcep import Reliability
from lockstep.rtc.endpoint import Connection
from lockstep.rtc.peer_events import Answered, Connected, MediaEvent, PacketReceived, PeerEnded, PeerEvent
from lockstep.rtc.rtp.stage import StreamEvent
from lockstep.rtc.sctp import Closed
from lockstep.server.auth.tokens import Identity
from lockstep.server.errors import ChannelError, DuplicateChannel, Flood, TooManyRequests
from lockstep.server.peers.agreed_channels import AgreedChannel
from lockstep.server.peers.channel_writer import ChannelWriter
from lockstep.server.peers.channels import ChannelName, MessageBudget, channel_name
from lockstep.server.peers.peer import Peer, PeerHost, PeerLimits, PeerStreams
from lockstep.server.talkback.talkback_arbiter import VoicePacket
from lockstep.server.webrtc.ice_session import IceSession

__all__ = ["WebRtcPeer"]

MAX_REQUESTS = 10.0  # Hz, of candidates and ICE restarts, after a burst of as many
# Reasons of `PeerEnded`, as the console reports them; all others are "connection closed".
ENDS = {
    "consent_expired": "consent expired",
    "no_path": "connection failed",
    "dtls_protocol": "connection failed",
    "dtls_fingerprint": "connection failed",
    "dtls_timeout": "connection failed",
    "dtls_too_much_handshake": "connection failed",
}
# Ends of an association that are nobody's fault.
ORDINARY = ("closed", "aborted", "peer_closed", "peer_aborted")


class PeerMediaStreams(PeerStreams, Protocol):
    """The media that a WebRTC peer gets; takes events of the connection too."""

    def connected(self) -> None: ...
    def heard(self, mid: str, event: StreamEvent) -> None: ...


class WebRtcPeer(Peer):
    """Give it every event of its connection: `connection.listen(peer.heard)`."""

    def __init__(
        self,
        connection: Connection,
        media: PeerMediaStreams,
        ice: IceSession,
        identity: Identity,
        host: PeerHost,
        limits: PeerLimits,
        *,
        take_voice: Callable[[VoicePacket], None] | None = None,
    ) -> None:
        super().__init__(media, identity, host, limits)
        self.resource = secrets.token_urlsafe(16)  # secret: the path of the WHEP resource
        self.ice = ice
        self._connection = connection
        self._streams = media
        self._take_voice = take_voice
        self._requests = MessageBudget(MAX_REQUESTS)
        self._names: dict[int, ChannelName] = {}  # of data channels, by number
        self._channel_writers: dict[int, ChannelWriter] = {}

    def take_request(self) -> None:
        """Count a PATCH. Raises TooManyRequests."""
        try:
            self._requests.spend(self._loop.time())
        except Flood as error:
            raise TooManyRequests(f"more than {MAX_REQUESTS:g} requests a second for one session") from error

    def agree_on(self, channels: Sequence[AgreedChannel]) -> None:
        """Open data channels together with the association, without a message that opens them."""
        for each in channels:
            reliability = Reliability(ordered=each.ordered, max_retransmits=each.max_retransmits)
            self._connection.peer.open_negotiated_channel(each.id, each.name, reliability=reliability)

    def heard(self, event: PeerEvent) -> None:
        """Take an event of its connection."""
        if isinstance(event, PeerEnded):
            if self._connection.fault is not None:
                self.failed("connection", self._connection.fault)
            self.end(ENDS.get(event.reason, "connection closed"))
        elif not self.ended:
            self._hear(event)

    def _hear(self, event: PeerEvent) -> None:
        if isinstance(event, ChannelMessage):
            if (name := self._names.get(event.channel)) is not None:
                self._received(name, event.data)
        elif isinstance(event, MediaEvent):
            with self.contained("rtcp"):
                self._streams.heard(event.mid, event.event)
        elif isinstance(event, PacketReceived):
            self._voice(event)
        elif isinstance(event, ChannelWritable):
            with self.contained("message out"):
                self._channel_writers[event.channel].flush()
        elif isinstance(event, Connected):
            with self.contained("answer"):
                self._streams.connected()
            self._connection_made()
        elif isinstance(event, Answered):
            self._connection.peer.note_round_trip(event.seconds)
        else:
            self._hear_of_channels(event)

    def _hear_of_channels(self, event: PeerEvent) -> None:
        if isinstance(event, ChannelOpened):
            with self.contained("channel"):
                self._open_channel(event)
        elif isinstance(event, ChannelClosed) and event.channel in self._names:
            self._channel_closed()
        elif isinstance(event, Closed) and event.reason not in ORDINARY:  # before a channel was opened
            self.transport_refused(event.reason)

    def _channel_closed(self) -> None:
        """End the peer: it closed the channel, or the association ended for a reason."""
        channels = self._connection.peer.channels
        closed = None if channels is None else channels.closed
        if closed is None or closed.reason in ORDINARY:
            self.end("channel closed")
        else:
            self.transport_refused(closed.reason)

    def _voice(self, event: PacketReceived) -> None:
        packet = event.packet
        if self._take_voice is not None and event.mid == self.voice and packet.payload:
            self._take_voice(VoicePacket(packet.sequence_number, packet.payload))

    def _open_channel(self, opened: ChannelOpened) -> None:
        try:
            name = channel_name(opened.label)
            if name in self._writers:
                raise DuplicateChannel(name)
        except ChannelError as error:
            self._refused("other", error)
            self._connection.close_channel(opened.channel)
            return
        self._names[opened.channel] = name
        writer = self._channel_writers[opened.channel] = ChannelWriter(self._connection, opened.channel)
        self._open(name, writer)

    async def _close_transport(self) -> None:
        self._connection.close()
