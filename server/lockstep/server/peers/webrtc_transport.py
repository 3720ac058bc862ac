"""A peer's messages by WebRTC: its connection and its data channels."""

import asyncio
import secrets
from collections.abc import Callable, Sequence
from typing import Protocol

from lockstep.rtc.channels import ChannelClosed, ChannelMessage, ChannelOpened, ChannelWritable
from lockstep.rtc.dcep import Reliability
from lockstep.rtc.endpoint import Connection
from lockstep.rtc.peer_events import Answered, Connected, MediaEvent, PacketReceived, PeerEnded, PeerEvent
from lockstep.rtc.rtp.stage import StreamEvent
from lockstep.rtc.sctp import Closed
from lockstep.server.errors import ChannelError, DuplicateChannel, Flood, TooManyRequests, TransportRefused
from lockstep.server.peers.agreed_channels import AgreedChannel
from lockstep.server.peers.channel_writer import ChannelWriter
from lockstep.server.peers.channels import ChannelName, MessageBudget, channel_name
from lockstep.server.peers.peer import PeerStreams
from lockstep.server.peers.transport import TransportEvents
from lockstep.server.talkback.talkback_arbiter import VoicePacket
from lockstep.server.webrtc.ice_session import IceSession

__all__ = ["PeerMediaStreams", "WebRtcTransport"]

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


class WebRtcTransport:
    """A `Transport`. Give it every event of its connection: `connection.listen(transport.heard)`."""

    def __init__(
        self,
        connection: Connection,
        media: PeerMediaStreams,
        ice: IceSession,
        *,
        take_voice: Callable[[VoicePacket], None] | None = None,
    ) -> None:
        self.resource = secrets.token_urlsafe(16)  # secret: the path of the WHEP resource
        self.ice = ice
        self._connection = connection
        self._media = media
        self._take_voice = take_voice
        self._requests = MessageBudget(MAX_REQUESTS)
        self._names: dict[int, ChannelName] = {}  # of data channels, by number
        self._writers: dict[ChannelName, ChannelWriter] = {}
        self._peer: TransportEvents | None = None

    def listen(self, events: TransportEvents) -> None:
        self._peer = events

    @property
    def lost(self) -> int:
        return sum(writer.lost for writer in self._writers.values())

    def send(self, channel: ChannelName, text: str) -> None:
        self._writers[channel].send(text)

    def send_newest(self, text: str) -> None:
        self._writers["control"].send_newest(text)

    def send_spare(self, text: str) -> None:
        self._writers["control"].send_spare(text)

    async def close(self) -> None:
        self._connection.close()

    def take_request(self) -> None:
        """Count a PATCH. Raises TooManyRequests."""
        try:
            self._requests.spend(asyncio.get_running_loop().time())
        except Flood as error:
            raise TooManyRequests(f"more than {MAX_REQUESTS:g} requests a second for one session") from error

    def agree_on(self, channels: Sequence[AgreedChannel]) -> None:
        """Open data channels together with the association, without a message that opens them."""
        for each in channels:
            reliability = Reliability(ordered=each.ordered, max_retransmits=each.max_retransmits)
            self._connection.open_negotiated_channel(each.id, each.name, reliability=reliability)

    def heard(self, event: PeerEvent) -> None:
        """Take an event of its connection."""
        peer = self._peer
        if peer is None:
            return
        if isinstance(event, PeerEnded):
            if self._connection.fault is not None:
                peer.failed("connection", self._connection.fault)
            peer.end(ENDS.get(event.reason, "connection closed"))
        elif not peer.ended:
            self._hear(event, peer)

    def _hear(self, event: PeerEvent, peer: TransportEvents) -> None:
        if isinstance(event, ChannelMessage):
            if (name := self._names.get(event.channel)) is not None:
                peer.received(name, event.data)
        elif isinstance(event, MediaEvent):
            with peer.contained("rtcp"):
                self._media.heard(event.mid, event.event)
        elif isinstance(event, PacketReceived):
            self._voice(event)
        elif isinstance(event, ChannelWritable):
            with peer.contained("message out"):
                self._writers[self._names[event.channel]].flush()
        elif isinstance(event, Connected):
            with peer.contained("answer"):
                self._media.connected()
            peer.liveness.connect()
        elif isinstance(event, Answered):
            self._connection.peer.share.round_trip.measure(event.seconds)
        else:
            self._hear_of_channels(event, peer)

    def _hear_of_channels(self, event: PeerEvent, peer: TransportEvents) -> None:
        if isinstance(event, ChannelOpened):
            with peer.contained("channel"):
                self._open_channel(event, peer)
        elif isinstance(event, ChannelClosed) and event.channel in self._names:
            self._channel_closed(peer)
        elif isinstance(event, Closed) and event.reason not in ORDINARY:  # before a channel was opened
            peer.refused("transport", TransportRefused(event.reason))

    def _channel_closed(self, peer: TransportEvents) -> None:
        """End the peer: it closed the channel, or the association ended for a reason."""
        channels = self._connection.peer.channels
        closed = None if channels is None else channels.closed
        if closed is None or closed.reason in ORDINARY:
            peer.end("channel closed")
        else:
            peer.refused("transport", TransportRefused(closed.reason))

    def _voice(self, event: PacketReceived) -> None:
        packet = event.packet
        if self._take_voice is not None and event.mid == self._media.voice and packet.payload:
            self._take_voice(VoicePacket(packet.sequence_number, packet.payload))

    def _open_channel(self, opened: ChannelOpened, peer: TransportEvents) -> None:
        try:
            name = channel_name(opened.label)
            if name in self._writers:
                raise DuplicateChannel(name)
        except ChannelError as error:
            peer.refused("other", error)
            self._connection.close_channel(opened.channel)
            return
        self._names[opened.channel] = name
        self._writers[name] = ChannelWriter(self._connection, opened.channel)
        peer.channel_opened(name)
