"""A peer on WebRTC: its connection and its data channels."""

import secrets
from collections.abc import Sequence

from aiortc import RTCDataChannel, RTCPeerConnection

from server.access import Identity
from server.agreed_channels import AgreedChannel
from server.channel_writer import ChannelWriter
from server.channels import MessageBudget, channel_name
from server.errors import ChannelError, DuplicateChannel, Flood, TooManyRequests
from server.ice_restart_private import IceSession
from server.media.aiortc_private import close_or_force
from server.peer import Peer, PeerHost, PeerLimits, PeerStreams

__all__ = ["WebRtcPeer"]

MAX_REQUESTS = 10.0  # Hz, of candidates and ICE restarts, after a burst of as many


class WebRtcPeer(Peer):
    def __init__(
        self,
        pc: RTCPeerConnection,
        media: PeerStreams,
        ice: IceSession,
        identity: Identity,
        host: PeerHost,
        limits: PeerLimits,
    ) -> None:
        super().__init__(media, identity, host, limits)
        self.resource = secrets.token_urlsafe(16)  # secret: the path of the WHEP resource
        self.pc = pc
        self.ice = ice
        ice.on_expired = lambda: self.end("consent expired")
        self._requests = MessageBudget(MAX_REQUESTS, self._loop.time())
        pc.on("datachannel", self._channel_offered)
        pc.on("connectionstatechange", self._connection_changed)

    def take_request(self) -> None:
        """Count a PATCH. Raises TooManyRequests."""
        try:
            self._requests.spend(self._loop.time())
        except Flood as error:
            raise TooManyRequests(f"more than {MAX_REQUESTS:g} requests a second for one session") from error

    def agree_on(self, channels: Sequence[AgreedChannel]) -> None:
        """Data channels that open with the association, without a message that says so."""
        for each in channels if self.pc.sctp is not None else ():
            channel = self.pc.createDataChannel(
                each.name, ordered=each.ordered, maxRetransmits=each.max_retransmits, negotiated=True, id=each.id
            )
            channel.once("open", lambda channel=channel: self._channel_offered(channel))

    async def _close_transport(self) -> None:
        try:
            with self.contained("close"):
                await self.ice.close()
        finally:  # also where that took longer than an end may
            await close_or_force(self.pc)

    # aiortc's events

    def _connection_changed(self) -> None:
        state = self.pc.connectionState
        if state == "connected":
            self._connection_made()
        elif state in ("failed", "closed"):
            self.end(f"connection {state}")

    def _channel_offered(self, channel: RTCDataChannel) -> None:
        with self.contained("channel"):
            self._open_channel(channel)

    def _open_channel(self, channel: RTCDataChannel) -> None:
        try:
            name = channel_name(channel.label)
            if name in self._writers:
                raise DuplicateChannel(name)
        except ChannelError as error:
            self._refused("other", error)
            channel.close()
            return
        writer = ChannelWriter(channel, lambda error: self.failed("message out", error))
        channel.on("message", lambda data: self._received(name, data))
        channel.on("close", lambda: self.end("channel closed"))
        self._open(name, writer)
